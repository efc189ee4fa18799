// The race track of Build mode with mouse, touch and keys: its points are dragged, added and removed; draws the line,
// the edges, the start line and the faults over the scene.
import { type Point, type Projection, svg } from '../editing/outline'
import { FIELDS } from '../fields'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import type { TrackBuilder } from './track_builder'
import { insertedAt, shapeOf } from './track_line'

/** Distance within which the pointer hits a point or the line, for a mouse and for a finger [CSS pixels]. */
const REACH = { fine: 14, coarse: 26 }
/** Movement after which a press is a drag [CSS pixels]. */
const SLACK = 4
/** Most places of a line that are drawn. */
const MAX_DRAWN = 400
const ARROWS: Record<string, Point> = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }

/** Handles the pointer on `canvas`; returns what is drawn over it. */
export function trackPointer(
  store: Store,
  builder: TrackBuilder,
  canvas: HTMLElement,
  view: () => SceneView | null,
): SVGElement {
  const drawing = svg('svg', { class: 'edit-overlay', 'aria-hidden': 'true' })
  drawing.dataset.testid = 'track-overlay'
  const paths = ['track-edge', 'track-edge', 'track-line', 'track-start'].map((name) => svg('path', { class: name }))
  const marks = svg('g', {})
  drawing.append(...paths, marks)
  const project: Projection = (x, y, z) => view()?.screenPoint(x, y, z) ?? null
  let press: { pointer: number; start: Point; index: number; isMoving: boolean } | null = null

  function reachOf(event: PointerEvent): number {
    return event.pointerType === 'mouse' ? REACH.fine : REACH.coarse
  }

  /** Index of the point near a place of the screen; -1: none. */
  function pointNear(at: Point, reach: number): number {
    const gaps = (builder.line?.points ?? []).map(([x, y]) => {
      const shown = project(x, y, 0)
      return shown ? Math.hypot(shown[0] - at[0], shown[1] - at[1]) : Infinity
    })
    const gap = Math.min(...gaps)
    return gap <= reach ? gaps.indexOf(gap) : -1
  }

  /** What each element of the drawing shows. */
  const shown = new Map<SVGElement, string>()

  function begin(event: PointerEvent): void {
    if (!builder.isActive || press || event.button !== 0 || !event.isPrimary) return
    const at: Point = [event.clientX, event.clientY]
    const index = pointNear(at, reachOf(event))
    press = { pointer: event.pointerId, start: at, index, isMoving: false }
    if (index < 0) return
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur()
    builder.selected.value = index
    // the camera must not move
    event.stopImmediatePropagation()
    event.preventDefault()
    canvas.setPointerCapture(event.pointerId)
  }

  function follow(event: PointerEvent): void {
    if (!builder.isActive) return
    const at: Point = [event.clientX, event.clientY]
    if (!press) canvas.style.cursor = pointNear(at, REACH.fine) >= 0 ? 'grab' : ''
    if (event.pointerId !== press?.pointer) return
    press.isMoving ||= Math.hypot(at[0] - press.start[0], at[1] - press.start[1]) > SLACK
    if (press.index < 0 || !press.isMoving) return
    event.stopImmediatePropagation()
    const ground = view()?.groundPoint(...at)
    if (ground) builder.show([...ground])
  }

  function end(event: PointerEvent): void {
    if (event.pointerId !== press?.pointer) return
    const { index, isMoving } = press
    press = null
    if (event.type !== 'pointerup') builder.cancel()
    else if (index >= 0 && isMoving) void builder.commit()
    else if (index < 0 && !isMoving) click([event.clientX, event.clientY], reachOf(event))
  }

  /** A click on the line adds a point; one beside it selects nothing. */
  function click(at: Point, reach: number): void {
    const ground = view()?.groundPoint(...at)
    const { line } = builder
    if (!ground || !line) return
    const { gap } = insertedAt(shapeOf(line).line, [...ground])
    const beside = project(ground[0] + gap, ground[1], 0)
    if (beside && Math.hypot(beside[0] - at[0], beside[1] - at[1]) <= reach) void builder.add([...ground])
    else builder.selected.value = -1
  }

  function onKey(event: KeyboardEvent): boolean {
    if (!builder.isActive || event.isComposing || event.altKey || event.ctrlKey || event.metaKey) return false
    if (!(event.target instanceof HTMLElement) || event.target.closest(FIELDS)) return false
    const isSelected = builder.selected.value >= 0
    const arrow = ARROWS[event.code]
    if (event.code === 'KeyN') builder.next(event.shiftKey ? -1 : 1)
    else if (arrow && isSelected) void builder.nudge(...arrow, event.shiftKey)
    else if (event.code === 'Enter' && isSelected && !event.target.closest('button')) void builder.addAfter()
    else if ((event.code === 'Delete' || event.code === 'Backspace') && isSelected) void builder.remove()
    else if (event.code === 'Escape' && isSelected) builder.selected.value = -1
    else return false
    return true
  }

  function draw(): void {
    const { line } = builder
    drawing.style.display = builder.isActive ? '' : 'none'
    if (!builder.isActive || !line) return
    const { line: smooth, edges, faults } = shapeOf(line)
    const drawn = [...[...edges, smooth.places].map(pathOf), startOf(edges)]
    for (const [i, path] of paths.entries()) change(path, drawn[i], () => path.setAttribute('d', drawn[i]))
    const parts: string[] = []
    for (const { kind, at: place } of faults) {
      const at = project(...place, 0)
      if (at) parts.push(`<circle class="fault" data-kind="${kind}" cx="${at[0]}" cy="${at[1]}" r="14"/>`)
    }
    line.points.forEach(([x, y], i) => {
      const at = project(x, y, 0)
      const name = `track-point${i === builder.selected.value ? ' selected' : ''}${i === 0 ? ' first' : ''}`
      if (at) parts.push(`<circle class="${name}" cx="${at[0].toFixed(1)}" cy="${at[1].toFixed(1)}" r="7"/>`)
    })
    const all = parts.join('')
    change(marks, all, () => (marks.innerHTML = all))
  }

  /** Changes an element of the drawing if it shows something else. */
  function change(element: SVGElement, what: string, show: () => void): void {
    if (shown.get(element) === what) return
    shown.set(element, what)
    show()
  }

  /** The start line, with an arrow in driving direction. */
  function startOf([[right], [left]]: [Point[], Point[]]): string {
    const [dx, dy] = [right[1] - left[1], left[0] - right[0]]
    const length = Math.hypot(dx, dy) || 1
    const middle: Point = [0.5 * (right[0] + left[0]), 0.5 * (right[1] + left[1])]
    const tip: Point = [middle[0] - (0.8 * dx) / length, middle[1] - (0.8 * dy) / length]
    const [a, b, c, d] = [right, left, middle, tip].map(([x, y]) => project(x, y, 0))
    if (!a || !b || !c || !d) return ''
    return `M${a.join(' ')}L${b.join(' ')}M${c.join(' ')}L${d.join(' ')}`
  }

  function pathOf(places: readonly Point[]): string {
    const step = Math.ceil(places.length / MAX_DRAWN)
    const shown = places.filter((_, i) => i % step === 0).map(([x, y]) => project(x, y, 0))
    const runs: string[] = []
    let run: string[] = []
    for (const at of [...shown, shown[0], null]) {
      if (at) run.push(`${at[0].toFixed(1)} ${at[1].toFixed(1)}`)
      else if (run.length > 1) runs.push(`M${run.join('L')}`)
      if (!at) run = []
    }
    return runs.join('')
  }

  const options = { capture: true } // before the controls of the camera
  canvas.addEventListener('pointerdown', begin, options)
  canvas.addEventListener('pointermove', follow, options)
  canvas.addEventListener('pointerup', end, options)
  canvas.addEventListener('pointercancel', end, options)
  window.addEventListener(
    'keydown',
    (event) => {
      if (!onKey(event)) return
      event.preventDefault()
      event.stopImmediatePropagation()
    },
    options,
  )
  store.imageCount.watch(draw)
  store.isBuilding.watch(draw)
  return drawing
}
