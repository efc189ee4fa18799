// Measures a distance on the ground: two points by click, or with the keyboard; the result is drawn over the view.
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { h, setText } from './element'
import { fixed } from './hud_rows'

/** A movement of the mouse between press and release that is still a click [CSS pixels]. */
const CLICK = 5
/** Steps of the cross with the arrow keys, and with Shift [CSS pixels]. */
const STEP = 16
const FINE_STEP = 2
const ARROWS: Record<string, [x: number, y: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
}

type Point = [x: number, y: number]

/** The layer over the canvas that shows the measured line. `view` is null until the 3D view is loaded. */
export function measure(store: Store, canvas: HTMLCanvasElement, view: () => SceneView | null): HTMLElement {
  const line = svg('line', { class: 'measured' })
  const ends = [svg('circle', { class: 'measured', r: 4 }), svg('circle', { class: 'measured', r: 4 })]
  const drawing = svg('svg', { 'aria-hidden': 'true' })
  drawing.append(line, ...ends)
  const result = h('output', { class: 'distance', testid: 'distance', role: 'status' })
  const cross = h('div', {
    ...{ class: 'cross', testid: 'measure-cross', tabindex: 0, role: 'application' },
    'aria-label': 'Point to measure. The arrow keys move it, Enter sets a point, Escape ends',
    onkeydown: onKey,
  })
  const element = h('div', { class: 'measure', testid: 'measure', hidden: true }, drawing, result, cross)
  const centre: Point = [0, 0]
  let points: Point[] = []
  let pressed: Point | null = null

  function set(x: number, y: number): void {
    const point = view()?.groundPoint(x, y)
    if (!point) return
    points = points.length === 2 ? [point] : [...points, point]
    const [[x0, y0], [x1, y1]] = [points[0], points[points.length - 1]]
    setText(result, points.length === 2 ? `${fixed(Math.hypot(x1 - x0, y1 - y0))} m` : '')
  }

  function onKey(event: KeyboardEvent): void {
    const arrow = ARROWS[event.key]
    if (!arrow && event.key !== 'Enter' && event.key !== 'Escape') return
    event.preventDefault()
    event.stopPropagation()
    if (event.key === 'Escape') store.isMeasuring.value = false
    else if (event.key === 'Enter') set(...centre)
    else move(arrow, event.shiftKey ? FINE_STEP : STEP)
  }

  function move([x, y]: Point, step: number): void {
    const { clientWidth, clientHeight } = canvas
    centre[0] = Math.max(0, Math.min(clientWidth, centre[0] + step * x))
    centre[1] = Math.max(0, Math.min(clientHeight, centre[1] + step * y))
    cross.style.translate = `${centre[0]}px ${centre[1]}px`
  }

  /** Draws the points where the camera sees them now. */
  function draw(): void {
    if (element.hidden) return
    const seen = points.map(([x, y]) => view()?.screenPoint(x, y, 0) ?? null)
    ends.forEach((end, i) => {
      const at = seen[i]
      end.toggleAttribute('hidden', !at)
      if (at) setAttributes(end, { cx: at[0], cy: at[1] })
    })
    const [a, b] = seen
    line.toggleAttribute('hidden', !a || !b)
    result.hidden = !a || !b
    if (!a || !b) return
    setAttributes(line, { x1: a[0], y1: a[1], x2: b[0], y2: b[1] })
    result.style.translate = `${(a[0] + b[0]) / 2}px ${(a[1] + b[1]) / 2}px`
  }

  canvas.addEventListener('pointerdown', (event) => (pressed = [event.clientX, event.clientY]))
  canvas.addEventListener('pointerup', ({ clientX, clientY }) => {
    const isClick = pressed && Math.hypot(clientX - pressed[0], clientY - pressed[1]) <= CLICK
    pressed = null
    if (isClick && store.isMeasuring.value) set(clientX, clientY)
  })
  store.imageCount.watch(draw)
  store.isMeasuring.watch((isMeasuring) => {
    element.hidden = !isMeasuring
    canvas.classList.toggle('measuring', isMeasuring)
    points = []
    setText(result, '')
    if (!isMeasuring) return
    ;[centre[0], centre[1]] = [canvas.clientWidth / 2, canvas.clientHeight / 2]
    move([0, 0], 0)
    store.notice.value = 'Click two points on the ground. Keyboard: arrow keys and Enter.'
    cross.focus({ preventScroll: true })
  })
  store.scene.watch(() => (points = []))
  return element
}

function svg<Tag extends keyof SVGElementTagNameMap>(
  tag: Tag,
  attributes: Record<string, string | number>,
): SVGElementTagNameMap[Tag] {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag)
  setAttributes(element, attributes)
  return element
}

function setAttributes(element: Element, attributes: Record<string, string | number>): void {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value))
}
