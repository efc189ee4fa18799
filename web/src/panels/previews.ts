// What the vehicle's own cameras see: their pictures as they come, with rate and age.
import type { Picture } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { fixed } from './hud_rows'
import type { Moment } from './hud_rows'

export interface Previews {
  element: HTMLElement
  /** Draws pictures that are new, and tells of those that are missing. */
  refresh: (moment: Moment) => void
}

/** The rate is that of pictures over so long a time [ms]. */
const WINDOW = 2000
/** A picture that is older than this [s] is drawn pale. */
const STALE = 1

/** Those of the report; a vehicle may have more. */
const ALWAYS = ['front', 'rear']

export function previews(store: Store): Previews {
  const element = h('div', { class: 'previews' })
  const all = new Map<string, Preview>()
  const hang = (camera: string) => {
    const preview = new Preview(camera)
    all.set(camera, preview)
    element.append(preview.element)
  }
  ALWAYS.forEach(hang)
  return {
    element,
    refresh(moment) {
      for (const camera of moment.scene?.cameras ?? []) if (!all.has(camera)) hang(camera)
      for (const [camera, preview] of all) {
        const isThere = moment.scene?.cameras.includes(camera) ?? true
        preview.element.hidden = !isThere && !ALWAYS.includes(camera)
        preview.refresh(moment, isThere, store.pictures.get(`${moment.name}/${camera}`) ?? null)
      }
    },
  }
}

class Preview {
  readonly element: HTMLElement
  private readonly canvas = h('canvas', { width: 320, height: 180 })
  private readonly state = h('span', { class: 'preview-state' })
  private readonly figures = h('span', { class: 'preview-figures' })
  private readonly view: HTMLButtonElement
  private readonly title: string
  private shown: Picture | null = null
  private isDrawing = false
  private readonly arrivals: number[] = []

  constructor(camera: string) {
    const name = camera.charAt(0).toUpperCase() + camera.slice(1)
    this.title = `${name} camera preview: rate, and age in simulated time. Press to enlarge`
    this.view = h(
      'button',
      { class: 'preview-view', title: this.title, 'aria-pressed': 'false', onclick: () => this.enlarge() },
      this.canvas,
      this.state,
    )
    const caption = h('figcaption', {}, h('span', {}, name), this.figures)
    this.element = h('figure', { class: 'preview', testid: `hud-${camera}-camera` }, this.view, caption)
  }

  refresh(moment: Moment, isThere: boolean, picture: Picture | null): void {
    const now = performance.now()
    if (picture && picture !== this.shown && !this.isDrawing) {
      this.arrivals.push(now)
      void this.draw(picture)
    }
    while (this.arrivals.length > 0 && this.arrivals[0]! < now - WINDOW) this.arrivals.shift()
    if (!picture) this.shown = null
    const age = picture && moment.frame ? Math.max(0, moment.frame.time - picture.time) : 0
    this.canvas.style.visibility = this.shown ? 'visible' : 'hidden'
    this.element.dataset.state = this.shown ? (age > STALE ? 'stale' : 'live') : 'none'
    const text = this.shown ? '' : missing(isThere, moment.status?.cameras_fault ?? '')
    setText(this.state, text)
    this.view.title = text || this.title
    setText(this.figures, this.shown ? `${fixed(this.rate(), 0)} Hz · ${ageText(age)}` : '')
  }

  private rate(): number {
    const [first = 0] = this.arrivals
    const last = this.arrivals[this.arrivals.length - 1] ?? 0
    return last > first ? ((this.arrivals.length - 1) * 1000) / (last - first) : 0
  }

  private async draw(picture: Picture): Promise<void> {
    this.isDrawing = true
    try {
      const bitmap = await createImageBitmap(new Blob([picture.jpeg.slice()], { type: 'image/jpeg' }))
      if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
        ;[this.canvas.width, this.canvas.height] = [bitmap.width, bitmap.height]
        this.view.style.setProperty('--aspect', `${bitmap.width} / ${bitmap.height}`)
      }
      this.canvas.getContext('2d')?.drawImage(bitmap, 0, 0)
      bitmap.close()
    } catch {
      // A picture that cannot be read is passed over; the next one comes soon.
    } finally {
      this.shown = picture
      this.isDrawing = false
    }
  }

  private enlarge(): void {
    const isLarge = this.element.classList.toggle('large')
    this.view.setAttribute('aria-pressed', String(isLarge))
  }
}

function missing(isThere: boolean, fault: string): string {
  if (!isThere) return 'no such camera'
  return fault ? `no pictures: ${fault}` : 'starting…'
}

/** The age of a picture [s], in steps that can be read. */
function ageText(age: number): string {
  return age < 1 ? `${Math.round(age * 100) * 10} ms` : `${age < 100 ? age.toFixed(1) : Math.round(age)} s`
}
