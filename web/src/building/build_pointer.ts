// Build mode with mouse and touch: open ends, the piece in hand, selection and dragging; draws them over the scene.
import { type Point, type Projection, svg } from '../editing/outline'
import type { MapModule, MapPart, MapScene, ModuleScene } from '../messages'
import { sceneUrl } from '../scene/assets'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { type Builder, blockCorners, type Hand, originOf } from './builder'
import {
  corners,
  freePorts,
  isSamePlace,
  middleOf,
  movedPart,
  outlineOf,
  type PortPlace,
  partAt,
  portAt,
  portsOf,
  sizeOf,
  transformTo,
} from './fitting'

/** Distance within which the pointer hits a port or a point, for a mouse and for a finger [CSS pixels]. */
const REACH = { fine: 16, coarse: 26 }
/** Movement after which a press is a drag [CSS pixels]. */
const SLACK = 5
/** Around the footprint in the drawing of a module [m]. */
const MARGIN = 0.1
/** Drawings of modules that were set and are not in the scene yet; of more of them, only the outlines are drawn. */
const MAX_PICTURES = 20
/** Radius of the mark of a port [CSS pixels]. */
const MARK = 9

interface Press {
  pointer: number
  start: Point
  /** The event that the camera did not get, because the part was pressed. */
  kept: PointerEvent | null
  /** From the ground under the pointer to the origin of the selected part [m]; null: the part is not dragged. */
  offset: Point | null
  isMoving: boolean
  /** The other corner of the rectangle that selects; null: there is none. */
  box: Point | null
}

/** Handles the pointer on `canvas`; returns what is drawn over it. */
export function buildPointer(
  store: Store,
  builder: Builder,
  canvas: HTMLElement,
  view: () => SceneView | null,
): HTMLElement {
  const drawing = svg('svg', { class: 'edit-overlay', 'aria-hidden': 'true' })
  /** Drawings of modules, below the lines. */
  const pictures: HTMLImageElement[] = []
  const overlay = document.createElement('div')
  overlay.dataset.testid = 'build-overlay'
  overlay.append(drawing)
  const project: Projection = (x, y, z) => view()?.screenPoint(x, y, z) ?? null
  let press: Press | null = null
  /** The latest drawing. */
  let before = ''

  function portNear(at: Point, reach: number): PortPlace | null {
    const scene = builder.scene
    const near = (scene ? freePorts(scene) : [])
      .map((port) => ({ port, shown: project(port.x, port.y, 0) }))
      .map(({ port, shown }) => ({ port, gap: shown ? Math.hypot(shown[0] - at[0], shown[1] - at[1]) : Infinity }))
      .sort((a, b) => a.gap - b.gap)[0]
    return near && near.gap <= reach ? near.port : null
  }

  /** With a second finger the camera moves: the first one neither drags nor sets. */
  function leaveToCamera(): void {
    const kept = press?.kept
    if (press?.offset && press.isMoving) builder.cancel()
    press = null
    if (kept) canvas.dispatchEvent(new PointerEvent('pointerdown', kept))
  }

  function begin(event: PointerEvent): void {
    if (store.isBuilding.value && press && !event.isPrimary) leaveToCamera()
    if (!store.isBuilding.value || press || event.button !== 0 || !event.isPrimary || !event.isTrusted) return
    const at: Point = [event.clientX, event.clientY]
    const ground = view()?.groundPoint(...at)
    const { scene } = builder
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur()
    press = { pointer: event.pointerId, start: at, kept: null, offset: null, isMoving: false, box: null }
    if (!scene || !ground || builder.hand.value) return
    const { selected } = builder
    const isOnSelected = selected.value.includes(partAt(scene, ground))
    if (event.shiftKey && !isOnSelected) press.box = at
    else if (isOnSelected) {
      const origin = originOf(scene.parts[selected.value[0]])
      press.offset = [origin[0] - ground[0], origin[1] - ground[1]]
    } else return
    // the camera must not move
    press.kept = event
    event.stopImmediatePropagation()
    event.preventDefault()
    canvas.setPointerCapture(event.pointerId)
  }

  function follow(event: PointerEvent): void {
    if (!store.isBuilding.value) return
    const at: Point = [event.clientX, event.clientY]
    const ground = view()?.groundPoint(...at)
    if (press && event.pointerId === press.pointer) {
      press.isMoving ||= Math.hypot(at[0] - press.start[0], at[1] - press.start[1]) > SLACK
      if (press.box) press.box = at
      if (press.offset && press.isMoving && ground) {
        if (!builder.hand.value) builder.lift()
        builder.moveTo([ground[0] + press.offset[0], ground[1] + press.offset[1]], at, project, event.shiftKey)
      }
      return
    }
    canvas.style.cursor = !builder.hand.value && portNear(at, REACH.fine) ? 'pointer' : ''
    if (event.pointerType === 'mouse' && event.buttons === 0 && ground && builder.hand.value)
      builder.moveTo(ground, at, project, event.shiftKey)
  }

  function end(event: PointerEvent): void {
    if (event.pointerId !== press?.pointer) return
    const { isMoving, offset, box, start } = press
    press = null
    const at: Point = [event.clientX, event.clientY]
    if (event.type !== 'pointerup') return void (offset && isMoving && builder.cancel())
    if (offset && isMoving) void builder.set()
    else if (box && isMoving) selectInside(start, box)
    else if (!isMoving) click(at, event)
  }

  function click(at: Point, event: PointerEvent): void {
    const ground = view()?.groundPoint(...at)
    const reach = event.pointerType === 'mouse' ? REACH.fine : REACH.coarse
    const { scene } = builder
    const hand = builder.hand.value
    if (!scene || !ground) return
    if (hand?.kind === 'wall' || hand?.kind === 'block') {
      const first = hand.points[0] && project(hand.points[0][0], hand.points[0][1], 0)
      builder.addPoint([...ground], !!first && Math.hypot(first[0] - at[0], first[1] - at[1]) <= reach)
      return
    }
    if (hand) {
      const isFinger = event.pointerType !== 'mouse'
      const isThere = (hand.kind === 'module' && (hand.target || isFinger)) || (hand.kind === 'part' && isFinger)
      const ghost: MapScene['parts'] = isThere ? { ghost: hand.part } : {}
      const isOnGhost = partAt({ ...scene, parts: ghost }, ground) !== ''
      if (!isFinger && !isOnGhost) builder.moveTo(ground, at, project, event.shiftKey)
      // a finger first moves the piece, then sets it
      if (!isFinger || isOnGhost) void builder.set()
      else builder.moveTo(ground, at, project, event.shiftKey)
      return
    }
    const port = portNear(at, reach)
    const name = partAt(scene, ground)
    if (name && (event.shiftKey || event.ctrlKey || event.metaKey)) builder.toggle(name)
    else if (port) builder.offer(port)
    else builder.select(...(name ? [name] : []))
  }

  /** Selects the parts whose middles are in a rectangle of the screen. */
  function selectInside(a: Point, b: Point): void {
    const { scene } = builder
    if (!scene) return
    const isBetween = (value: number, i: number): boolean =>
      value >= Math.min(a[i], b[i]) && value <= Math.max(a[i], b[i])
    const names = Object.entries(scene.parts).filter(([, part]) => {
      const shown = project(...middleOf([part], scene), 0)
      return shown?.every(isBetween)
    })
    builder.select(...names.map(([name]) => name))
  }

  // -- the drawing -----------------------------------------------------------------------------------------------

  function draw(): void {
    const { scene } = builder
    overlay.hidden = !store.isBuilding.value || !scene
    if (!store.isBuilding.value || !scene) return
    const hand = builder.hand.value
    const parts: string[] = []
    const isLifted = hand && (hand.kind === 'group' ? !hand.isNew : 'moved' in hand && hand.moved !== '')
    if (!isLifted) for (const part of Object.values(builder.parts)) parts.push(outline(part, 'selected'))
    const placed = builder.placed.value.flatMap((edit) => edit.parts)
    for (const part of placed) parts.push(outline(part, 'placed'))
    if (press?.box) parts.push(`<path class="hand" d="${frame(press.start, press.box)}"/>`)
    for (const port of portsOf(scene)) if (port.state !== 'joined') parts.push(mark(port))
    if (hand) parts.push(...drawHand(hand))
    const drawn = parts.join('')
    if (drawn !== before) drawing.innerHTML = before = drawn
    const modules = placed.filter((part) => part.type === 'MapModule').slice(0, MAX_PICTURES)
    const shown = hand?.kind === 'module' ? [...modules, hand.part] : modules
    for (let i = 0; i < Math.max(shown.length, pictures.length); i++) showPicture(i, shown[i], i >= modules.length)
  }

  function drawHand(hand: Hand): string[] {
    const { scene } = builder
    if (!scene) return []
    if (hand.kind === 'wall' || hand.kind === 'block') {
      const points = hand.end ? [...hand.points, hand.end] : hand.points
      if (hand.kind === 'block' && points.length === 2) return [path(blockCorners(points[0], points[1]), 'hand', false)]
      const dots = hand.points.map(([x, y]) => project(x, y, 0)).filter((at) => at !== null)
      return [path(points, 'hand', true), ...dots.map(([x, y]) => `<circle class="dot" cx="${x}" cy="${y}" r="5"/>`)]
    }
    if (hand.kind === 'group')
      return Object.values(hand.parts).map((part) => outline(movedPart(part, ...hand.shift), 'hand'))
    const line = outline(hand.part, 'hand')
    const module = hand.kind === 'module' ? builder.module(hand.part) : undefined
    if (hand.kind !== 'module' || !module)
      return [line, hand.part.type === 'MapProp' ? arrow(hand.part.x, hand.part.y, hand.part.yaw) : '']
    const seams = builder.joints(hand).map((joint) => mark({ ...joint, state: 'joined' }, 'seam'))
    const others = portsOf(scene).filter(({ part }) => part !== hand.moved)
    const ports = Object.entries(module.ports).map(([name, port]): PortPlace => {
      const at = portAt(hand.part, port)
      const state = others.some((other) => isSamePlace(other, at)) ? 'joined' : 'free'
      return { part: '', name, width: port.width, state, ...at }
    })
    return [line, ...seams, ...ports.map((port) => mark(port))]
  }

  /** The drawing of a module where it is, or where it would be: a ghost. */
  function showPicture(i: number, part: MapModule | undefined, isGhost: boolean): void {
    const module = part && builder.module(part)
    const shown = module && placeOf(part, module)
    const picture = pictures[i] ?? document.createElement('img')
    picture.style.display = shown ? '' : 'none'
    if (!module || !shown) return
    if (!(i in pictures)) {
      pictures[i] = picture
      picture.alt = ''
      drawing.before(picture)
    }
    picture.className = isGhost ? 'build-picture ghost' : 'build-picture'
    const address = sceneUrl(module.image).href
    if (picture.src !== address) picture.src = address
    const [length, width] = [module.length + 2 * MARGIN, module.width + 2 * MARGIN]
    picture.style.width = `${100 * length}px`
    picture.style.height = `${100 * width}px`
    picture.style.clipPath = `inset(${(100 * MARGIN) / width}% ${(100 * MARGIN) / length}%)`
    picture.style.transform = transformTo(100 * length, 100 * width, shown)
  }

  /** The corners of the drawing of a module on the screen, from the upper left one. */
  function placeOf(part: MapModule, module: ModuleScene): Point[] | null {
    if (module.type === 'terrain') return null
    const [length, width] = sizeOf(part, module)
    const [a, b, c, d] = corners(part, [length + 2 * MARGIN, width + 2 * MARGIN])
    const shown = [b, a, d, c].map(([x, y]) => project(x, y, 0))
    return shown.every((at) => at !== null) ? shown : null
  }

  /** The mark of a port: an arrow that points outward; or of a joint, where a piece can be inserted: a plus. */
  function mark({ x, y, yaw, state }: PortPlace, name = 'port'): string {
    const [at, out] = [project(x, y, 0), project(x + 0.05 * Math.cos(yaw), y + 0.05 * Math.sin(yaw), 0)]
    if (!at || !out) return ''
    const angle = (Math.atan2(out[1] - at[1], out[0] - at[0]) * 180) / Math.PI
    const place = `translate(${at[0].toFixed(1)} ${at[1].toFixed(1)}) rotate(${angle.toFixed(1)})`
    if (name === 'seam') return `<g class="seam" transform="${place}"><path d="M0 -9V9M-4 0H4"/></g>`
    return `<g class="port" data-state="${state}" transform="${place}"><circle r="${MARK}"/><path d="M-3 -4 4 0 -3 4Z"/></g>`
  }

  function arrow(x: number, y: number, yaw: number): string {
    const [at, to] = [project(x, y, 0), project(x + 0.2 * Math.cos(yaw), y + 0.2 * Math.sin(yaw), 0)]
    return at && to ? `<path class="hand" d="M${at.join(' ')}L${to.join(' ')}"/>` : ''
  }

  function outline(part: MapPart, name: string): string {
    const { scene } = builder
    return scene ? path(outlineOf(part, scene), name, part.type === 'MapWall' && !part.is_closed) : ''
  }

  function path(points: readonly Point[], name: string, isOpen: boolean): string {
    const shown = points.map(([x, y]) => project(x, y, 0))
    if (shown.length < 2 || !shown.every((at) => at !== null)) return ''
    const line = shown.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join('L')
    const d = `M${line}${isOpen ? '' : 'Z'}`
    return `<path class="under" d="${d}"/><path class="${name}" d="${d}"/>`
  }

  const options = { capture: true } // before the controls of the camera
  canvas.addEventListener('pointerdown', begin, options)
  canvas.addEventListener('pointermove', follow, options)
  canvas.addEventListener('pointerleave', ({ pointerType }) => pointerType === 'mouse' && builder.leave())
  canvas.addEventListener('pointerup', end, options)
  canvas.addEventListener('pointercancel', end, options)
  store.imageCount.watch(draw)
  store.isBuilding.watch(draw)
  builder.placed.watch(draw) // at once
  return overlay
}

/** A rectangle between two corners. */
function frame([x0, y0]: Point, [x1, y1]: Point): string {
  return `M${x0} ${y0}H${x1}V${y1}H${x0}Z`
}
