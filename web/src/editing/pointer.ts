// Edit mode with mouse and touch: selects and drags vehicles and objects, turns them by their handle, draws the outline.
import type { Pose } from '../messages'
import type { SceneView } from '../scene/view'
import type { Placement, Store } from '../store'
import type { Editor } from './editor'
import {
  cornersOf,
  type Extent,
  extentOf,
  handleOf,
  isHit,
  middleOf,
  type Point,
  type Projection,
  svg,
} from './outline'

/** Distance within which the pointer hits the handle, and a thing, for a mouse and for a finger [CSS pixels]. */
const REACH = { handle: { fine: 12, coarse: 24 }, thing: { fine: 2, coarse: 14 } }
/** Movement after which a press is a drag [CSS pixels]. */
const SLACK = 4
/** Step of the heading while Shift is held [rad]. */
const SNAP = Math.PI / 12

interface Drag {
  pointer: number
  start: Point
  kind: 'move' | 'turn'
  /** From the point of the ground under the pointer to the origin of the thing [m], and to its heading [rad]. */
  offset: readonly [x: number, y: number, yaw: number]
  isMoving: boolean
}

/** Handles the pointer on `canvas`; returns the overlay, an SVG of the size of the window. */
export function editPointer(
  store: Store,
  editor: Editor,
  canvas: HTMLElement,
  view: () => SceneView | null,
): SVGSVGElement {
  const overlay = svg('svg', { class: 'edit-overlay', 'data-testid': 'edit-overlay', 'aria-hidden': 'true' })
  const box = { under: svg('path', { class: 'under' }), line: svg('path', { class: 'line' }) }
  const lever = { under: svg('line', { class: 'under' }), line: svg('line', { class: 'line' }) }
  const handle = svg('circle', { class: 'handle', r: '9' })
  overlay.append(box.under, lever.under, box.line, lever.line, handle)
  const project: Projection = (x, y, z) => view()?.screenPoint(x, y, z) ?? null
  let drag: Drag | null = null

  /** What the pointer hits: the handle of the selected thing, or a thing. */
  function hit(at: Point, reach: 'fine' | 'coarse'): { name: string; kind: Drag['kind'] } | null {
    const selected = outlined(store.selection.value)
    const end = selected && handleOf(selected.pose, selected.extent, project)?.[1]
    if (end && Math.hypot(end[0] - at[0], end[1] - at[1]) <= REACH.handle[reach])
      return { name: store.selection.value, kind: 'turn' }
    const hits = editor.names
      .map(outlined)
      .filter((one) => one !== null)
      .filter(({ pose, extent }) => isHit(at, pose, extent, project, REACH.thing[reach]))
    const distance = ({ placed, pose, extent }: Outlined): number => {
      const middle = project(...middleOf(placed, extent), pose.position[2] - extent.below + 0.5 * extent.size[2])
      return middle ? Math.hypot(middle[0] - at[0], middle[1] - at[1]) : Number.POSITIVE_INFINITY
    }
    const nearest = hits.sort((a, b) => distance(a) - distance(b))[0]
    return nearest ? { name: nearest.placed.name, kind: 'move' } : null
  }

  function outlined(name: string): Outlined | null {
    const placed = editor.placement(name)
    const extent = extentOf(store.scene.value, name)
    const pose = editor.pose(name)
    return placed && extent && pose ? { placed, extent, pose } : null
  }

  function begin(event: PointerEvent): void {
    if (!store.isEditing.value || drag || event.button !== 0 || !event.isPrimary) return
    const at: Point = [event.clientX, event.clientY]
    const found = hit(at, event.pointerType === 'mouse' ? 'fine' : 'coarse')
    const ground = view()?.groundPoint(...at)
    if (!found || !ground) return
    // the camera must not move
    event.stopImmediatePropagation()
    event.preventDefault()
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur()
    canvas.setPointerCapture(event.pointerId)
    store.selection.value = found.name
    const one = outlined(found.name)
    if (!one) return
    const { placed } = one
    drag = {
      pointer: event.pointerId,
      start: at,
      kind: found.kind,
      offset: [placed.x - ground[0], placed.y - ground[1], placed.yaw - bearing(one, ground)],
      isMoving: false,
    }
    draw()
  }

  function follow(event: PointerEvent): void {
    const at: Point = [event.clientX, event.clientY]
    if (!drag) {
      const isOver = store.isEditing.value && event.buttons === 0 && hit(at, 'fine')
      canvas.style.cursor = isOver ? 'grab' : ''
      return
    }
    if (event.pointerId !== drag.pointer) return
    drag.isMoving ||= Math.hypot(at[0] - drag.start[0], at[1] - drag.start[1]) > SLACK
    const ground = view()?.groundPoint(...at)
    const one = outlined(store.selection.value)
    if (!drag.isMoving || !ground || !one) return
    canvas.style.cursor = 'grabbing'
    if (drag.kind === 'move') {
      editor.show({ x: ground[0] + drag.offset[0], y: ground[1] + drag.offset[1] })
    } else {
      const yaw = bearing(one, ground) + drag.offset[2]
      turnAboutMiddle(editor, one, event.shiftKey ? SNAP * Math.round(yaw / SNAP) : yaw)
    }
  }

  function end(event: PointerEvent): void {
    if (event.pointerId !== drag?.pointer) return
    const { isMoving } = drag
    drag = null
    canvas.style.cursor = ''
    if (isMoving && event.type === 'pointerup') void editor.commit()
    else editor.cancel()
  }

  /** Draws the box around the selected thing. */
  function draw(): void {
    const one = store.isEditing.value ? outlined(store.selection.value) : null
    const corners = one && cornersOf(one.pose, one.extent, project)
    const line = one && handleOf(one.pose, one.extent, project)
    overlay.style.display = corners && line ? '' : 'none'
    if (!corners || !line) return
    const [a, b, c, d, e, f, g, h] = corners.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`)
    const edges = `M${a} ${b} ${c} ${d}Z M${e} ${f} ${g} ${h}Z M${a} ${e} M${b} ${f} M${c} ${g} M${d} ${h}`
    for (const path of [box.under, box.line]) path.setAttribute('d', edges)
    const [[x1, y1], [x2, y2]] = line
    for (const one of [lever.under, lever.line])
      for (const [name, value] of Object.entries({ x1, y1, x2, y2 })) one.setAttribute(name, value.toFixed(1))
    handle.setAttribute('cx', x2.toFixed(1))
    handle.setAttribute('cy', y2.toFixed(1))
  }

  function drawFrames(): void {
    draw()
    if (store.isEditing.value) requestAnimationFrame(drawFrames)
  }

  const options = { capture: true } // before the controls of the camera
  canvas.addEventListener('pointerdown', begin, options)
  canvas.addEventListener('pointermove', follow, options)
  canvas.addEventListener('pointerup', end, options)
  canvas.addEventListener('pointercancel', end, options)
  store.isEditing.watch(drawFrames)
  return overlay
}

interface Outlined {
  placed: Placement
  extent: Extent
  pose: Pose
}

/** Bearing of a point of the ground from the middle of a thing [rad]. */
function bearing({ placed, extent }: Outlined, ground: Point): number {
  const [x, y] = middleOf(placed, extent)
  return Math.atan2(ground[1] - y, ground[0] - x)
}

/** Shows the selected thing at another heading [rad]; its middle stays where it is. */
export function turnAboutMiddle(editor: Editor, { placed, extent }: Outlined, yaw: number): void {
  const [x, y] = middleOf(placed, extent)
  editor.show({ x: x - extent.ahead * Math.cos(yaw), y: y - extent.ahead * Math.sin(yaw), yaw })
}
