// Previews of the cameras of the vehicle, with the rate and age of their images.
import type { Picture, Status } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import type { HudState } from './hud_rows'
import { fixed } from './hud_rows'

export interface Previews {
  /** The front camera. */
  front: HTMLElement
  others: HTMLElement
  /** Draws new images, and shows why images are missing; of the front camera only, unless the others are shown. */
  refresh: (state: HudState, areOthersShown: boolean) => void
}

/** Window over which the rate is measured [ms]. */
const WINDOW = 2000
/** An image that is older than this [s] is shown as stale. */
const STALE_AGE = 1

/** The cameras of the report, for which there is a place before the scene is known; a vehicle may have others. */
const STANDARD = ['front', 'rear']

export function previews(store: Store): Previews {
  const front = h('div', { class: 'previews' })
  const others = h('div', { class: 'previews' })
  const all = new Map<string, Preview>()
  const add = (camera: string) => {
    const preview = new Preview(camera)
    all.set(camera, preview)
    ;(camera === 'front' ? front : others).append(preview.element)
  }
  STANDARD.forEach(add)
  return {
    front,
    others,
    refresh(state, areOthersShown) {
      const mounted = state.scene?.cameras ?? STANDARD
      for (const camera of mounted) if (!all.has(camera)) add(camera)
      for (const [camera, preview] of all) {
        preview.element.hidden = !mounted.includes(camera)
        if (areOthersShown || camera === 'front')
          preview.refresh(state, store.cameraImages.get(`${state.name}/${camera}`) ?? null)
      }
      front.hidden = !mounted.includes('front')
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
    this.title = `${name} camera, with image rate and age in simulated time. Click to enlarge`
    this.view = h(
      'button',
      { class: 'preview-view', title: this.title, 'aria-pressed': 'false', onclick: () => this.enlarge() },
      this.canvas,
      this.state,
    )
    const caption = h('figcaption', {}, h('span', {}, name), this.figures)
    this.element = h('figure', { class: 'preview', testid: `hud-${camera}-camera` }, this.view, caption)
  }

  refresh(state: HudState, image: Picture | null): void {
    const now = performance.now()
    if (image && image !== this.shown && !this.isDrawing) {
      this.arrivals.push(now)
      void this.draw(image)
    }
    while (this.arrivals.length > 0 && this.arrivals[0] < now - WINDOW) this.arrivals.shift()
    if (!image) this.shown = null
    const age = image && state.frame ? Math.max(0, state.frame.time - image.time) : 0
    this.canvas.style.visibility = this.shown ? 'visible' : 'hidden'
    this.element.dataset.state = this.shown ? (age > STALE_AGE ? 'stale' : 'live') : 'none'
    const text = this.shown ? '' : statusText(state.status)
    setText(this.state, text)
    this.view.title = text || this.title
    const rate = this.rate()
    setText(this.figures, this.shown && rate > 0 ? `${fixed(rate, 0)} Hz · ${ageText(age)}` : '')
  }

  private rate(): number {
    const [first = 0] = this.arrivals
    const last = this.arrivals[this.arrivals.length - 1] ?? 0
    return last > first ? ((this.arrivals.length - 1) * 1000) / (last - first) : 0
  }

  private async draw(image: Picture): Promise<void> {
    this.isDrawing = true
    try {
      const bitmap = await createImageBitmap(new Blob([image.jpeg.slice()], { type: 'image/jpeg' }))
      if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
        ;[this.canvas.width, this.canvas.height] = [bitmap.width, bitmap.height]
        this.view.style.setProperty('--aspect', `${bitmap.width} / ${bitmap.height}`)
      }
      this.canvas.getContext('2d')?.drawImage(bitmap, 0, 0)
      bitmap.close()
    } catch {
      // Skip an image that cannot be decoded; the next one follows soon.
    } finally {
      this.shown = image
      this.isDrawing = false
    }
  }

  private enlarge(): void {
    const isLarge = this.element.classList.toggle('large')
    this.view.setAttribute('aria-pressed', String(isLarge))
  }
}

function statusText(status: Status | null): string {
  if (status?.cameras_error) return `no images: ${status.cameras_error}`
  return status?.cameras_note || 'starting…'
}

/** The age of an image [s] as text, rounded to 10 ms so that it stays readable. */
function ageText(age: number): string {
  return age < 1 ? `${Math.round(age * 100) * 10} ms` : `${age < 100 ? age.toFixed(1) : Math.round(age)} s`
}
