// Build mode: the piece in hand, the selected part, and the requests that change the map.
import { type Actions, sentence } from '../actions'
import { keyText } from '../driving/key_caps'
import type { Point, Projection } from '../editing/outline'
import { saveText } from '../editing/save_text'
import type { MapModule, MapPart, MapProblem, MapProp, MapScene, ModuleScene, ServerOperation } from '../messages'
import { Observable } from '../observable'
import { stem } from '../scenario_title'
import type { Store } from '../store'
import { MAX_FILE } from './bytes'
import {
  areaAround,
  connectedParts,
  fittingModules,
  fittingPorts,
  freePlace,
  freePorts,
  groupSnap,
  inMap,
  isSamePlace,
  jointsOf,
  meeting,
  middleOf,
  mirrorPort,
  movedPart,
  outlineOf,
  type PortPlace,
  type Pose,
  portAt,
  portsOf,
  replacements,
  snapped,
  turnedPart,
  wrapped,
} from './fitting'
import type { Picture, PictureOptions } from './picture'

/** What the user is about to set: a module, a sign, or a wall or block of which some points are known.
 *
 * `target`: the end that it is joined to; `end`: the end for which it was chosen.
 */
export type Hand =
  | { kind: 'module'; part: MapModule; port: string; target: PortPlace | null; end: PortPlace | null; moved: string }
  | { kind: 'part'; part: MapPart; moved: string }
  | { kind: 'group'; parts: Record<string, MapPart>; isNew: boolean; shift: Point }
  | { kind: 'wall'; points: Point[]; end: Point | null }
  | { kind: 'block'; points: Point[]; end: Point | null }

type HandOf<Kind extends Hand['kind']> = Extract<Hand, { kind: Kind }>

/** Parts that the simulator was asked to set, until an image shows them. */
interface Placed {
  parts: readonly MapPart[]
  isSet: boolean
}

/** Steps of the arrow keys, with and without Shift [m]. */
const STEP = { coarse: 0.1, fine: 0.01 }
/** Around the map when all of it is shown [m]. */
const MARGIN = 0.5
const QUARTER = Math.PI / 2
const TURN = Math.PI / 12
/** Parts that one edit may change. */
const MAX_PARTS = 1000
/** Sizes of new walls and blocks [m]. */
const WALL = { thickness: 0.1, height: 0.25, is_closed: false }
const BLOCK_HEIGHT = 0.3

export class Builder {
  readonly hand = new Observable<Hand | null>(null)
  /** Names of the selected parts. */
  readonly selected = new Observable<readonly string[]>([])
  /** Edits whose parts no image of the scene shows yet. */
  readonly placed = new Observable<readonly Placed[]>([])
  /** Names that this page has used, also of parts that the simulator has not added yet. */
  private readonly taken = new Set<string>()
  /** Whether the selected parts are in hand because arrow keys move them. */
  private isNudged = false
  private isSettling = false

  constructor(
    private readonly store: Store,
    private readonly actions: Actions,
  ) {
    store.scene.watch((scene) => {
      if (scene?.timeline) store.isBuilding.value = false // a replay cannot be changed
      const left = this.selected.value.filter((name) => this.scene?.parts[name])
      if (left.length < this.selected.value.length) this.selected.value = left
    })
    store.shownScene.watch(() => (this.placed.value = this.placed.value.filter(({ isSet }) => !isSet)))
    store.isBuilding.watch((isBuilding) => {
      if (isBuilding) store.isMeasuring.value = false
      else this.select()
    })
  }

  /** The map; null if it is a race track. */
  get scene(): MapScene | null {
    return this.store.scene.value?.map_scene ?? null
  }

  /** Of the map or race track. */
  get problemCount(): number {
    return (this.scene ?? this.store.scene.value?.track_scene)?.problems.length ?? 0
  }

  /** The selected part; null if none or several are selected. */
  get part(): MapPart | null {
    return this.selected.value.length === 1 ? (this.scene?.parts[this.selected.value[0]] ?? null) : null
  }

  /** All selected parts. */
  get parts(): Record<string, MapPart> {
    const { scene } = this
    return scene ? Object.fromEntries(this.selected.value.map((name) => [name, scene.parts[name]])) : {}
  }

  /** What is in hand, if it is of that kind. */
  private inHand<Kind extends Hand['kind']>(kind: Kind): HandOf<Kind> | null {
    const { value } = this.hand
    return value?.kind === kind ? (value as HandOf<Kind>) : null
  }

  module(part: MapModule): ModuleScene | undefined {
    return this.scene?.modules[part.module]
  }

  // -- the piece in hand ---------------------------------------------------------------------------------------

  /** Takes a new module; the pointer moves it. */
  take(name: string, at: Point): void {
    const module = this.scene?.modules[name]
    if (!module) return
    const size = module.type === 'terrain' ? { length: 2, width: 2 } : {}
    this.select()
    this.hand.value = {
      ...{ kind: 'module', moved: '', target: null, end: null, port: Object.keys(module.ports)[0] ?? '' },
      part: { ...plain(name), x: at[0], y: at[1], ...size },
    }
  }

  /** Takes a new module at the first open end to which it fits; without one, at the free place nearest to `at`. */
  takeAtEnd(name: string, at: Point): void {
    const module = this.scene?.modules[name]
    const ends = this.scene ? freePorts(this.scene).filter(({ state }) => state !== 'open') : []
    const end = module && ends.find(({ width }) => fittingPorts(module, width).length > 0)
    this.select()
    if (end) this.join(name, end, this.portAfter(name, end))
    else if (module && this.scene) this.take(name, freePlace(this.scene, [module.length, module.width], at))
    if (end) this.actions.view?.showPlace(end.x, end.y)
  }

  takeProp(kind: string, at: Point): void {
    this.select()
    this.hand.value = {
      kind: 'part',
      moved: '',
      part: { type: 'MapProp', kind, x: at[0], y: at[1], yaw: 0 } as MapProp,
    }
  }

  /** Starts a wall or a block, which the next clicks define. */
  start(kind: 'wall' | 'block'): void {
    this.select()
    this.hand.value = { kind, points: [], end: null }
  }

  /** Offers the pieces that fit to a port; the first one is in hand. */
  offer(target: PortPlace): void {
    const { scene } = this
    const fitting = scene ? fittingModules(scene, target.width) : []
    const isJoint = target.state === 'joined'
    const names = fitting.filter((name) => !isJoint || (scene && canBeInserted(scene.modules[name], target)))
    if (names.length === 0) return
    const before = this.inHand('module')?.part.module
    const used = before && names.includes(before) ? before : names[0]
    this.select()
    this.join(used, target, this.portAfter(used, target))
    this.actions.view?.showPlace(target.x, target.y)
  }

  /** Names of the modules between which the arrow keys step. */
  get offered(): string[] {
    const { scene } = this
    const target = this.inHand('module')?.target
    if (!scene) return []
    if (!target) return Object.keys(scene.modules)
    const names = fittingModules(scene, target.width)
    return target.state === 'joined' ? names.filter((name) => canBeInserted(scene.modules[name], target)) : names
  }

  /** Takes the next or the previous piece. */
  step(by: 1 | -1): void {
    const hand = this.inHand('module')
    const names = this.offered
    if (!hand || hand.moved || names.length === 0) return
    this.change(names[(names.indexOf(hand.part.module) + by + names.length) % names.length])
  }

  /** Takes another piece at the same place. */
  change(name: string): void {
    const hand = this.inHand('module')
    if (hand?.target) this.join(name, hand.target)
    else if (hand) this.take(name, [hand.part.x, hand.part.y])
  }

  /** Goes to the next open end; if there is none, to the next joint, where a piece can be inserted. */
  nextPort(): void {
    const { scene } = this
    const ends = scene ? freePorts(scene).filter(({ state }) => state !== 'open') : []
    const ports = scene && ends.length === 0 ? jointsOf(scene) : ends
    if (ports.length === 0) return
    const target = this.inHand('module')?.target
    const now = ports.findIndex(({ part, name }) => part === target?.part && name === target?.name)
    this.offer(ports[(now + 1) % ports.length])
    if (ends.length === 0) this.store.notice.value = 'No end is open: Enter inserts the piece here, into the road.'
  }

  /** The joints at which a new module in hand can be inserted. */
  joints(hand: HandOf<'module'>): PortPlace[] {
    const { scene } = this
    const module = this.module(hand.part)
    return scene && module && !hand.moved ? jointsOf(scene).filter((joint) => canBeInserted(module, joint)) : []
  }

  /** Modules that can replace the selected one. */
  get replacements(): { module: string; pose: Pose }[] {
    return this.scene && this.part ? replacements(this.scene, this.selected.value[0]) : []
  }

  /** Replaces the selected module by another one with the same ports. */
  async replace(module: string, pose: Pose): Promise<void> {
    const [before] = this.selected.value
    const part = { ...plain(module), ...pose }
    const name = this.freeName(stemOf(part))
    if (before && (await this.put({ [before]: null, [name]: part }))) this.select(name)
  }

  /** Joins the piece in hand by its next port, or turns what is in hand or selected about its middle. */
  turn(by: 1 | -1): void {
    const hand = this.hand.value
    switch (hand?.kind) {
      case 'module':
      case 'part': {
        const [part] = Object.values(this.turned({ '': hand.part }, by))
        if (hand.kind === 'module' && hand.target) this.joinByNext(hand, hand.target, by)
        else this.hand.value = { ...hand, part } as Hand
        break
      }
      case 'group':
        this.hand.value = { ...hand, parts: this.turned(hand.parts, by) }
        break
      case undefined:
        if (this.selected.value.length > 0) void this.put(this.turned(this.parts, by))
    }
  }

  /** Joins the module in hand by its next or its previous port. */
  private joinByNext(hand: HandOf<'module'>, target: PortPlace, by: 1 | -1): void {
    const module = this.module(hand.part)
    const names = module ? fittingPorts(module, target.width) : []
    if (names.length === 1) this.store.notice.value = `${module?.title} has one end: it can be joined in one way.`
    else this.join(hand.part.module, target, names[(names.indexOf(hand.port) + by + names.length) % names.length])
  }

  /** Parts that are turned about their middle: by a quarter if one of them has ports, otherwise by 15 degrees. */
  private turned(parts: Record<string, MapPart>, by: 1 | -1): Record<string, MapPart> {
    if (!this.scene) return parts
    const all = Object.values(parts)
    const middle = middleOf(all, this.scene)
    const hasPorts = all.some((part) => part.type === 'MapModule' && Object.keys(this.module(part)?.ports ?? {}).length)
    return mapped(parts, (part) => turnedPart(part, middle, by * (hasPorts ? QUARTER : TURN)))
  }

  /** Mirrors the module in hand or the selected one: it stays joined, or keeps the place of a port. */
  mirror(): void {
    const hand = this.inHand('module')
    const part = hand?.part ?? (this.hand.value ? null : this.part)
    const module = part?.type === 'MapModule' ? this.module(part) : undefined
    if (part?.type !== 'MapModule' || !module) return
    const by = hand ? hand.port : this.joinedPort(this.selected.value[0])
    const port = by && mirrorPort(module, by)
    if (!port) this.store.notice.value = `${module.title} has no mirror image.`
    else if (hand?.target) this.join(part.module, hand.target, port)
    else {
      const from = portAt(part, module.ports[by])
      const mirrored = { ...part, ...meeting(module.ports[port], { ...from, yaw: from.yaw + Math.PI }) }
      if (hand) this.hand.value = { ...hand, port, part: mirrored }
      else void this.put({ [this.selected.value[0]]: mirrored })
    }
  }

  /** The first port of a module that is joined, or its first one; empty: it has none. */
  private joinedPort(name: string): string {
    const ports = this.scene?.ports[name] ?? {}
    const names = Object.keys(ports)
    return names.find((one) => ports[one].state === 'joined') ?? names[0] ?? ''
  }

  /** Moves what is in hand to a point of the ground; it snaps to a port near the pointer unless it `isFree`. */
  moveTo(ground: Point, pointer: Point, project: Projection, isFree: boolean): void {
    const hand = this.hand.value
    if (this.isNudged) return
    const shiftOf = (part: MapPart): Point => [ground[0] - originOf(part)[0], ground[1] - originOf(part)[1]]
    switch (hand?.kind) {
      case 'wall':
      case 'block':
        this.hand.value = { ...hand, end: ground }
        break
      case 'group': {
        const shift = shiftOf(Object.values(hand.parts)[0])
        this.hand.value = { ...hand, shift: (!isFree && this.snapOfGroup(hand, shift, project)) || shift }
        break
      }
      case 'part':
        this.hand.value = { ...hand, part: movedPart(hand.part, ...shiftOf(hand.part)) }
        break
      case 'module': {
        const part = { ...hand.part, x: ground[0], y: ground[1] }
        const module = this.module(part)
        const targets = this.scene && !isFree ? this.targets(hand.moved) : []
        const own = { pose: part, port: hand.port }
        const snap =
          module &&
          (snapped(module, own, targets, pointer, project) ??
            snapped(module, own, isFree ? [] : this.joints(hand), pointer, project, true))
        this.hand.value = snap
          ? { ...hand, part: { ...part, ...snap.pose }, port: snap.port, target: snap.target }
          : { ...hand, part, target: null }
      }
    }
  }

  /** Moves what is in hand, or the selected parts, by a step of the arrow keys along x and y; then `settle`. */
  nudge(right: number, up: number, isFine: boolean): void {
    if (!this.hand.value && this.selected.value.length > 0) {
      this.lift()
      this.isNudged = true
    }
    const step = isFine ? STEP.fine : STEP.coarse
    const [dx, dy] = [right * step, up * step]
    const hand = this.hand.value
    switch (hand?.kind) {
      case 'group':
        this.hand.value = { ...hand, shift: [hand.shift[0] + dx, hand.shift[1] + dy] }
        break
      case 'part':
        this.hand.value = { ...hand, part: movedPart(hand.part, dx, dy) }
        break
      case 'module':
        this.hand.value = { ...hand, target: null, end: null, part: movedPart(hand.part, dx, dy) as MapModule }
    }
  }

  /** Sets the selected parts where the arrow keys have moved them: one edit for all steps until the keys are released. */
  async settle(): Promise<void> {
    if (!this.isNudged || this.isSettling) return
    this.isSettling = true
    let hand = this.hand.value
    for (let isSet = true; isSet && hand; hand = this.hand.value) {
      const parts = hand.kind === 'group' ? mapped(hand.parts, shifterOf(hand.shift)) : partsOf(hand)
      isSet = await this.put(parts)
      if (!isSet || this.hand.value === hand) this.hand.value = null // otherwise keys have moved them on meanwhile
    }
    this.isSettling = this.isNudged = false
  }

  /** The pointer has left the scene, for a button or another piece: the piece in hand is at its open end again. */
  leave(): void {
    const hand = this.inHand('module')
    if (hand?.end && hand.target !== hand.end && !hand.moved) this.join(hand.part.module, hand.end, hand.port)
  }

  /** Adds a point of a wall or block; the wall is closed by a click near its first point. */
  addPoint(point: Point, isAtStart: boolean): void {
    const hand = this.inHand('wall') ?? this.inHand('block')
    if (!hand) return
    const points = [...hand.points, point]
    if (hand.kind === 'wall' && isAtStart && hand.points.length > 2) void this.setWall(hand.points, true)
    else if (hand.kind === 'block' && points.length === 2) void this.setBlock(points)
    else this.hand.value = { ...hand, points }
  }

  /** Sets what is in hand; a joined road then goes on at its other end. */
  async set(): Promise<void> {
    const hand = this.hand.value
    if (this.isNudged) return this.settle()
    switch (hand?.kind) {
      case 'wall':
        return this.setWall(hand.points, false)
      case 'group':
        return this.setGroup(hand)
      case 'module':
      case 'part':
        return this.setPart(hand)
    }
  }

  private async setGroup({ parts, shift }: HandOf<'group'>): Promise<void> {
    const isSet = this.put(mapped(parts, shifterOf(shift)))
    this.hand.value = null
    if (await isSet) this.selected.value = Object.keys(parts)
  }

  /** Inserts the module in hand at a joint; it comes back if that is refused. */
  private async insert(hand: HandOf<'module'>, joint: PortPlace): Promise<void> {
    this.hand.value = null
    const { part, name: port } = joint
    const isSet = await this.request({ type: 'InsertModule', module: hand.part.module, part, port, entry: hand.port })
    if (!isSet && this.hand.value === null) this.hand.value = hand
  }

  private async setPart(hand: HandOf<'module' | 'part'>): Promise<void> {
    if (hand.kind === 'module' && hand.target?.state === 'joined' && !hand.moved) return this.insert(hand, hand.target)
    const name = hand.moved || this.freeName(stemOf(hand.part))
    const joined = hand.kind === 'module' && hand.target ? hand : null
    const next = joined && !hand.moved ? this.nextTarget(joined, name) : null
    // the next piece is in hand at once, so that a second Enter does not set this one again
    if (joined && next) this.join(joined.part.module, next, joined.port)
    else if (hand.moved || joined) this.hand.value = null
    const after = this.hand.value
    const isSet = await this.put({ [name]: hand.part })
    // it comes back if it was refused, unless the user has taken something else meanwhile
    if (!isSet && !hand.moved && this.hand.value === after) this.hand.value = hand
  }

  /** Deletes the piece in hand that is not set yet; a piece that is moved goes back; without one, selects nothing. */
  cancel(): void {
    if (this.hand.value) this.hand.value = null
    else if (this.selected.value.length > 0) this.selected.value = []
    else this.store.notice.value = keyText('Done, or the key {KeyZ}, ends Build mode.')
  }

  select(...names: string[]): void {
    this.hand.value = null
    this.selected.value = names
  }

  /** Adds a part to the selection, or removes it. */
  toggle(name: string): void {
    const { value } = this.selected
    this.select(...(value.includes(name) ? value.filter((one) => one !== name) : [...value, name]))
  }

  /** Selects the next or the previous part of the map, and shows it. */
  selectNext(by: 1 | -1): void {
    const { scene } = this
    const names = Object.keys(scene?.parts ?? {})
    if (!scene || names.length === 0) return
    const now = names.indexOf(this.selected.value[0])
    const name = names[now < 0 ? (by > 0 ? 0 : names.length - 1) : (now + by + names.length) % names.length]
    this.select(name)
    this.actions.view?.showPlace(...originOf(scene.parts[name]))
  }

  /** Selects all modules that are connected with a selected one. */
  selectConnected(): void {
    const { scene } = this
    if (scene) this.select(...new Set(this.selected.value.flatMap((name) => connectedParts(scene, name))))
  }

  selectAll(): void {
    this.select(...Object.keys(this.scene?.parts ?? {}))
  }

  /** Adds the roads from the open end in hand to the nearest other one, or between the selected modules. */
  async close(): Promise<void> {
    const target = this.inHand('module')?.target
    const [part, other] = this.selected.value
    if (target) await this.closeAt(target)
    else if (!this.hand.value && part && this.selected.value.length <= 2)
      await this.request({ type: 'CloseLoop', part, port: '', other: other ?? '', other_port: '' })
    else this.store.notice.value = 'Choose an open end, or one or two pieces that have open ends.'
  }

  /** Adds the roads from the open end at a place to the nearest other one. */
  async closeAt(at: Pick<Pose, 'x' | 'y'>): Promise<void> {
    const port = this.scene && freePorts(this.scene).find((one) => isSamePlace(one, { ...at, yaw: 0 }))
    if (!port) return
    this.hand.value = null
    await this.request({ type: 'CloseLoop', part: port.part, port: port.name, other: '', other_port: '' })
  }

  /** Closes all open ends as one edit; says how many are left. */
  async closeAll(): Promise<void> {
    this.select()
    if (!(await this.request({ type: 'CloseLoop', part: '', port: '', other: '', other_port: '' }))) return
    const left = this.openEnds.length
    const ends = left === 1 ? '1 open end is' : `${left} open ends are`
    if (left > 0) this.store.warning.value = `${ends} left: no road fits there. Make room, or let it stay open.`
  }

  /** Lets all open ends stay open, as one edit. */
  leaveOpen(): Promise<boolean> {
    const parts: Record<string, MapPart> = {}
    for (const { part: name, name: port } of this.openEnds) {
      const part = parts[name] ?? this.scene?.parts[name]
      if (part?.type !== 'MapModule' || part.open === true) continue
      parts[name] = { ...part, open: [...(part.open || []), port] }
    }
    return this.put(parts)
  }

  /** The ends that have no neighbour and may not stay open. */
  get openEnds(): PortPlace[] {
    return this.scene ? portsOf(this.scene).filter(({ state }) => state === 'free') : []
  }

  /** Shows the whole map. */
  showAll(): void {
    const { scene } = this
    const area = scene && areaAround(Object.values(scene.parts).flatMap((part) => [...outlineOf(part, scene)]))
    if (area) this.actions.view?.showArea(area[0], area[1], area[2] + MARGIN)
  }

  // -- parts of the map ----------------------------------------------------------------------------------------

  /** Takes the selected parts in hand to move them. */
  lift(): void {
    const { part, parts } = this
    const [moved] = this.selected.value
    if (this.selected.value.length > 1) this.hand.value = { kind: 'group', parts, isNew: false, shift: [0, 0] }
    if (part?.type === 'MapModule') {
      const port = Object.keys(this.module(part)?.ports ?? {})[0] ?? ''
      this.hand.value = { kind: 'module', part, port, target: null, end: null, moved }
    } else if (part) this.hand.value = { kind: 'part', part, moved }
  }

  /** Takes a copy of the selected parts in hand. */
  duplicate(): void {
    this.lift()
    const hand = this.hand.value
    switch (hand?.kind) {
      case 'group': {
        const copies = Object.entries(hand.parts).map(([name, part]) => [
          this.freeName(name.replace(/_\d+$/, '')),
          part,
        ])
        this.hand.value = { kind: 'group', parts: Object.fromEntries(copies), isNew: true, shift: [0.3, 0.3] }
        break
      }
      case 'module':
        this.hand.value = { ...hand, moved: '', part: { ...hand.part, open: false } }
        break
      case 'part':
        this.hand.value = { ...hand, moved: '', part: movedPart(hand.part, 0.3, 0.3) }
    }
  }

  /** Deletes the selected parts, or the piece in hand. */
  async remove(): Promise<void> {
    const { parts } = this
    this.hand.value = null
    if (this.selected.value.length > 0 && (await this.put(mapped(parts, () => null)))) this.select()
  }

  /** Changes values of the selected part. */
  setValues(values: Partial<MapModule>): Promise<boolean> {
    return this.put({ [this.selected.value[0]]: { ...this.part, ...values } as MapPart })
  }

  /** Places the viewed vehicle on the lane that enters the selected module, so that it starts there. */
  async placeVehicle(): Promise<void> {
    const [port] = Object.values(this.scene?.ports[this.selected.value[0]] ?? {})
    if (!port) return
    // traffic keeps right: the lane lies a quarter of the road to the right of its middle
    const [x, y] = inMap(port, 0, 0.25 * port.width)
    await this.placeAt(this.store.vehicle.value, [x, y, wrapped(port.yaw + Math.PI)])
  }

  /** Places a vehicle, also where it starts after a reset [m, rad]. */
  placeAt(name: string, [x, y, yaw]: readonly [x: number, y: number, yaw: number]): Promise<boolean> {
    return this.request({ type: 'Place', name, x, y, yaw })
  }

  /** Shows where a problem is. */
  show({ x, y, parts, vehicle }: MapProblem): void {
    this.select(...parts.slice(-1))
    const at = this.store.frame.value?.vehicles[vehicle]?.pose.position ?? [x, y]
    this.actions.view?.lookAt(at[0], at[1])
  }

  repair({ repair }: MapProblem): Promise<boolean> {
    return this.put(repair)
  }

  /** Starts from a map of the simulator, or from the text of a map's file. */
  use(map: { name: string } | { text: string }): Promise<boolean> {
    this.select()
    return this.request({ type: 'UseMap', ...map })
  }

  /** Makes the track of a picture the map; returns what is wrong with it. */
  async importTrack({ name, bytes }: Picture, options: PictureOptions): Promise<readonly string[]> {
    const { text, errors } = await this.actions.attempt({
      ...{ type: 'ImportTrack', picture: bytes, name: stem(name).slice(0, 100) },
      ...options,
    })
    if (text) this.store.warning.value = sentence(text)
    if (errors.length === 0) this.select()
    return errors
  }

  /** The map as the text of a YAML file; null if the simulator did not answer. */
  text(title: string): Promise<string | null> {
    return this.actions.textOf({ type: 'SaveMap', title })
  }

  /** Downloads the map as a YAML file. */
  async save(title: string, name: string): Promise<boolean> {
    const text = await this.text(title)
    if (text === null) return false
    saveText(`${stem(name)}.yaml`, text, 'application/yaml')
    this.store.hasUnsavedEdits.value = false
    return true
  }

  /** Puts parts into the map, or removes them (null), as one edit; returns whether the simulator made it. */
  put(parts: Record<string, MapPart | null>): Promise<boolean> {
    const known = this.scene?.parts ?? {}
    const seen = Object.fromEntries(Object.keys(parts).map((name) => [name, known[name] ?? null]))
    const operation = { type: 'EditMap', parts, seen } as const
    if (Object.keys(parts).length > MAX_PARTS || JSON.stringify(operation).length > MAX_FILE) {
      this.store.warning.value = `These are too many pieces for one edit. Select at most ${MAX_PARTS}.`
      return Promise.resolve(false)
    }
    return this.request(operation)
  }

  private async request(operation: ServerOperation): Promise<boolean> {
    const { placed, store } = this
    const parts = operation.type === 'EditMap' ? Object.values(operation.parts) : []
    const edit = { parts: parts.filter((part) => part !== null), isSet: false }
    placed.value = [...placed.value, edit]
    const text = await this.actions.textOf(operation)
    edit.isSet = text !== null // the Scene with it has come
    if (!edit.isSet || store.shownScene.value === store.scene.value)
      placed.value = placed.value.filter((one) => one !== edit)
    if (text) store.warning.value = sentence(text)
    return edit.isSet
  }

  /** The piece of that name at a port, joined by its first port that fits, or by `port`. */
  private join(name: string, target: PortPlace, port?: string): void {
    const module = this.scene?.modules[name]
    const by = module && (port ?? fittingPorts(module, target.width)[0])
    if (!module || !by) return
    const pose = meeting(module.ports[by], target)
    const hand = this.inHand('module')
    const part = hand?.part.module === name ? hand.part : plain(name)
    this.hand.value = {
      kind: 'module',
      moved: hand?.moved ?? '',
      port: by,
      target,
      end: target,
      part: { ...part, ...pose },
    }
  }

  /** The port by which a module goes on where one of its kind ends: a curve after a curve bends the same way. */
  private portAfter(name: string, { part, name: end, width }: PortPlace): string | undefined {
    const [before, module] = [this.scene?.parts[part], this.scene?.modules[name]]
    if (before?.type !== 'MapModule' || before.module !== name || !module) return undefined
    return fittingPorts(module, width).find((one) => one !== end)
  }

  /** Ports to which a piece can snap; a piece that is moved leaves its neighbours behind. */
  private targets(moved: string): PortPlace[] {
    const { scene } = this
    if (!scene) return []
    if (!moved) return freePorts(scene)
    const own = Object.values(scene.ports[moved] ?? {})
    const isLeft = (port: Pose): boolean => own.some((one) => isSamePlace(one, port))
    return portsOf(scene).filter((port) => port.part !== moved && (port.state !== 'joined' || isLeft(port)))
  }

  /** The other end of a piece that was set, if it is open; the road goes on there. */
  private nextTarget({ part, port }: HandOf<'module'>, name: string): PortPlace | null {
    const module = this.module(part)
    if (!module || !this.scene) return null
    const others = portsOf(this.scene)
    const ends = Object.keys(module.ports)
      .filter((one) => one !== port)
      .map((one): PortPlace => {
        const { width } = module.ports[one]
        return { part: name, name: one, width, state: 'free', ...portAt(part, module.ports[one]) }
      })
    return ends.find((end) => !others.some((other) => isSamePlace(other, end))) ?? null
  }

  /** The shift with which an end of a group in hand meets another end near it. */
  private snapOfGroup(hand: HandOf<'group'>, shift: Point, project: Projection): Point | null {
    if (hand.isNew || !this.scene) return null
    const ports = portsOf(this.scene)
    const inside = ports.filter(({ part }) => part in hand.parts)
    const outside = ports.filter(({ part }) => !(part in hand.parts))
    const isInner = (port: PortPlace): boolean =>
      inside.some((other) => other.part !== port.part && isSamePlace(other, port))
    const ends = inside.filter((port) => !isInner(port))
    const targets = outside.filter((port) => port.state !== 'joined' || ends.some((end) => isSamePlace(end, port)))
    return groupSnap(ends, shift, targets, project)
  }

  private async setWall(points: Point[], isClosed: boolean): Promise<void> {
    if (points.length < 2) return
    const wall: MapPart = { type: 'MapWall', points: points.map(([x, y]) => [x, y]), ...WALL, is_closed: isClosed }
    if (await this.put({ [this.freeName('wall')]: wall })) this.hand.value = { kind: 'wall', points: [], end: null }
  }

  private async setBlock([[x0, y0], [x1, y1]]: Point[]): Promise<void> {
    const [length, width] = [Math.max(Math.abs(x1 - x0), 0.01), Math.max(Math.abs(y1 - y0), 0.01)]
    const middle = { x: 0.5 * (x0 + x1), y: 0.5 * (y0 + y1), yaw: 0 }
    const block: MapPart = { type: 'MapBlock', ...middle, length, width, height: BLOCK_HEIGHT }
    this.hand.value = { kind: 'block', points: [], end: null }
    await this.put({ [this.freeName('block')]: block })
  }

  private freeName(start: string): string {
    const { frame } = this.store
    const used = { ...this.scene?.parts, ...frame.value?.objects, ...frame.value?.vehicles }
    let number = 1
    while (`${start}_${number}` in used || this.taken.has(`${start}_${number}`)) number++
    this.taken.add(`${start}_${number}`)
    return `${start}_${number}`
  }
}

/** Whether a module has two ends that fit to a joint. */
function canBeInserted(module: ModuleScene, { width }: PortPlace): boolean {
  return fittingPorts(module, width).length > 1
}

/** A module with the values of its file. */
function plain(module: string): MapModule {
  const own = { open: false, length: null, width: null, height: null, z: 0, mass: null }
  return { type: 'MapModule', module, x: 0, y: 0, yaw: 0, ...own }
}

function stemOf(part: MapPart): string {
  if (part.type === 'MapProp') return part.kind
  if (part.type === 'MapWall') return 'wall'
  return part.type === 'MapModule' ? stem(part.module.replace(/^.*\//, '')) : 'block'
}

/** The part in hand, by its name in the map. */
function partsOf(hand: Hand): Record<string, MapPart> {
  return 'moved' in hand ? { [hand.moved]: hand.part } : {}
}

function shifterOf(shift: Point): (part: MapPart) => MapPart {
  return (part) => movedPart(part, ...shift)
}

/** Where a part is. */
export function originOf(part: MapPart): Point {
  return part.type === 'MapWall' ? part.points[0] : [part.x, part.y]
}

function mapped<T>(parts: Record<string, MapPart>, change: (part: MapPart) => T): Record<string, T> {
  return Object.fromEntries(Object.entries(parts).map(([name, part]) => [name, change(part)]))
}

/** The corners of a block between two of them. */
export function blockCorners([x0, y0]: Point, [x1, y1]: Point): Point[] {
  return [
    [x0, y0],
    [x1, y0],
    [x1, y1],
    [x0, y1],
  ]
}
