// The race track of Build mode: its points, the selected one, and the requests that change it.
import { type Actions, sentence } from '../actions'
import type { Point } from '../editing/outline'
import type { ServerOperation, TrackLine, TrackScene } from '../messages'
import { Observable } from '../observable'
import type { Store } from '../store'
import { areaAround } from './fitting'
import { insertedAt, MAX_POINTS, MIN_POINTS, POINT_GAP, shapeOf } from './track_line'

/** The half axes of a new track [m]. */
const [LENGTH, HEIGHT] = [11, 7]
const COUNT = 12
/** Around the track when all of it is shown [m]. */
const MARGIN = 3
/** Steps of the arrow keys, with and without Shift [m]. */
const STEP = { coarse: 0.5, fine: 0.1 }

export class TrackBuilder {
  /** Index of the selected point; -1: none. */
  readonly selected = new Observable(-1)
  /** The track while it is changed, before the simulator has it. */
  readonly draft = new Observable<TrackLine | null>(null)
  /** The edits that the simulator has not answered yet. */
  private pending = 0

  constructor(
    private readonly store: Store,
    private readonly actions: Actions,
  ) {
    store.scene.watch(() => {
      if (this.pending === 0) this.draft.value = null
      if (this.selected.value >= (this.line?.points.length ?? 0)) this.selected.value = -1
    })
    store.isBuilding.watch((isBuilding) => {
      if (!isBuilding) this.selected.value = -1
    })
  }

  /** The track of the simulator; null if the map is not a race track. */
  get scene(): TrackScene | null {
    return this.store.scene.value?.track_scene ?? null
  }

  /** The track as it is shown. */
  get line(): TrackLine | null {
    return this.draft.value ?? this.scene?.line ?? null
  }

  get isActive(): boolean {
    return this.store.isBuilding.value && this.line !== null
  }

  /** Shows the whole track. */
  showAll(): void {
    const area = areaAround(this.line?.points ?? [])
    if (area) this.actions.view?.showArea(area[0], area[1], area[2] + MARGIN)
  }

  /** Starts a new track: an oval around the origin. */
  start(): Promise<boolean> {
    const points = Array.from({ length: COUNT }, (_, i): [number, number] => {
      const angle = (2 * Math.PI * i) / COUNT
      return [rounded(LENGTH * Math.sin(angle)), rounded(-HEIGHT * Math.cos(angle))]
    })
    return this.put({ points, width: 1.2, barrier: 'wall' }, null)
  }

  /** A random track. */
  async generate(seed: number, length: number, width: number): Promise<boolean> {
    const barrier = this.line?.barrier ?? 'wall'
    this.selected.value = -1
    return this.request({ type: 'GenerateTrack', seed, length, width, barrier })
  }

  /** Shows the selected point elsewhere, before `commit`. */
  show([x, y]: Point): void {
    const { line } = this
    const index = this.selected.value
    if (!line || index < 0) return
    this.draft.value = { ...line, points: spliced(line.points, index, 1, [rounded(x), rounded(y)]) }
  }

  /** Makes what is shown the track of the simulator. */
  async commit(): Promise<boolean> {
    const { value } = this.draft
    return value !== null && this.put(value)
  }

  /** Shows the track of the simulator again. */
  cancel(): void {
    if (this.pending === 0) this.draft.value = null
  }

  /** Adds a point on the line near a place, and selects it. */
  add(at: Point): Promise<boolean> {
    const { line } = this
    if (!line) return Promise.resolve(false)
    if (line.points.length >= MAX_POINTS) return this.refuse(`A track has at most ${MAX_POINTS} points.`)
    const { index } = insertedAt(shapeOf(line).line, at)
    const point: [number, number] = [rounded(at[0]), rounded(at[1])]
    const points = spliced(line.points, index, 0, point)
    const isAdded = this.put({ ...line, points })
    this.selected.value = index
    return isAdded
  }

  /** Adds a point in the middle between the selected point and the next one. */
  addAfter(): Promise<boolean> {
    const { line } = this
    const index = Math.max(this.selected.value, 0)
    if (!line) return Promise.resolve(false)
    const { places, parameters } = shapeOf(line).line
    const middle = parameters.findIndex((parameter) => parameter >= index + 0.5)
    return this.add(places[middle] ?? places[0])
  }

  /** Removes the selected point. */
  remove(): Promise<boolean> {
    const { line } = this
    const index = this.selected.value
    if (!line || index < 0) return Promise.resolve(false)
    if (line.points.length <= MIN_POINTS) return this.refuse(`A track has at least ${MIN_POINTS} points.`)
    this.selected.value = index % (line.points.length - 1)
    return this.put({ ...line, points: spliced(line.points, index, 1) })
  }

  /** Moves the selected point by steps along x and y. */
  nudge(dx: number, dy: number, isFine: boolean): Promise<boolean> {
    const point = this.line?.points[this.selected.value]
    if (!point) return Promise.resolve(false)
    const step = isFine ? STEP.fine : STEP.coarse
    this.show([point[0] + dx * step, point[1] + dy * step])
    return this.commit()
  }

  /** Selects the next point, or the one before. */
  next(by: 1 | -1): void {
    const count = this.line?.points.length ?? 0
    if (count > 0) this.selected.value = this.selected.value < 0 ? 0 : (this.selected.value + by + count) % count
  }

  /** The start line goes through the selected point. */
  startHere(): Promise<boolean> {
    const { line } = this
    const index = this.selected.value
    if (!line || index < 0) return Promise.resolve(false)
    this.selected.value = 0
    return this.put({ ...line, points: [...line.points.slice(index), ...line.points.slice(0, index)] })
  }

  /** The cars drive in the other direction. */
  reverse(): Promise<boolean> {
    const { line } = this
    if (!line) return Promise.resolve(false)
    this.selected.value = -1
    return this.put({ ...line, points: [line.points[0], ...line.points.slice(1).reverse()] })
  }

  setValues(values: Partial<Pick<TrackLine, 'width' | 'barrier'>>): Promise<boolean> {
    const { line } = this
    return line ? this.put({ ...line, ...values }) : Promise.resolve(false)
  }

  /** Makes a track the map of the simulator, as one edit; returns whether the simulator made it. */
  private async put(track: TrackLine, seen = this.pending === 0 ? (this.scene?.line ?? null) : null): Promise<boolean> {
    const { points } = track
    const near = points.some(([x, y], i) => {
      const [a, b] = points[(i + 1) % points.length]
      return Math.hypot(a - x, b - y) < POINT_GAP
    })
    if (near) return this.refuse('Neighbouring points must be at least 5 cm apart.')
    this.draft.value = track
    return this.request({ type: 'EditTrack', track, seen })
  }

  private async request(operation: ServerOperation): Promise<boolean> {
    this.pending++
    const text = await this.actions.textOf(operation)
    this.pending--
    if (text) this.store.warning.value = sentence(text)
    if (text === null || operation.type === 'GenerateTrack') this.cancel()
    return text !== null
  }

  private refuse(text: string): Promise<boolean> {
    this.store.warning.value = text
    this.cancel()
    return Promise.resolve(false)
  }
}

function spliced<T>(values: readonly T[], index: number, removed: number, ...added: T[]): T[] {
  return [...values.slice(0, index), ...added, ...values.slice(index + removed)]
}

function rounded(value: number): number {
  return Math.round(value * 1000) / 1000
}
