// The smooth closed line through the points of a track, its edges and its faults: the formulas of the simulator
// (scenario/tracks/points.py), so that they are drawn while a point is dragged.
import type { Point } from '../editing/outline'
import type { TrackLine } from '../messages'

/** A place where the track cannot be driven. */
export interface Fault {
  kind: 'bend' | 'touch' | 'narrow'
  at: Point
  /** The nearest point of the track, from 0. */
  point: number
  /** Radius, distance of two parts, or width [m], and the least one. */
  value: number
  least: number
}

export interface SmoothLine {
  places: Point[]
  /** Number of the point before each place, and the share of the way to the next one. */
  parameters: number[]
}

const SPACING = 0.1
const [MIN_PLACES, MAX_PLACES] = [16, 2000]
const WIDTH_MIN = 0.9
const INNER_RADIUS = 0.1
const BETWEEN = 0.05
const MAX_FAULTS = 20
const STEPS = 40
const ROUNDS = 60
/** Least distance of neighbouring points [m]. */
export const POINT_GAP = 0.05
export const [MIN_POINTS, MAX_POINTS] = [3, 200]

/** The periodic cubic spline through points, whose parameter is centripetal; places at equal distances. */
export function smoothLine(points: readonly Point[]): SmoothLine {
  const n = points.length
  const h = Float64Array.from(points, (point, i) => Math.sqrt(distance(point, points[(i + 1) % n])))
  const [xs, ys] = coordinates(points)
  const [mx, my] = [secondDerivatives(xs, h), secondDerivatives(ys, h)]
  /** One coordinate of a place, by the values of the points and their second derivatives. */
  const value = (p: Float64Array, m: Float64Array, parameter: number): number => {
    const i = Math.min(Math.floor(parameter), n - 1)
    const j = i < n - 1 ? i + 1 : 0
    const t = (parameter - i) * h[i]
    const r = h[i] - t
    const cubic = (m[i] * (r * r * r) + m[j] * (t * t * t)) / (6 * h[i])
    return cubic + (p[i] / h[i] - (m[i] * h[i]) / 6) * r + (p[j] / h[i] - (m[j] * h[i]) / 6) * t
  }
  const steps = n * STEPS
  const fine = (p: Float64Array, m: Float64Array): Float64Array =>
    new Float64Array(steps).map((_, k) => value(p, m, k / STEPS))
  const along = lengths(fine(xs, mx), fine(ys, my))
  const length = along[steps]
  const count = Math.min(Math.max(Math.round(length / SPACING), MIN_PLACES), MAX_PLACES)
  const parameters: number[] = []
  for (let k = 0, i = 0; k < count; k++) {
    const wanted = k * (length / count)
    while (i < steps - 1 && along[i + 1] <= wanted) i++
    parameters.push((i + (wanted - along[i]) / (along[i + 1] - along[i])) / STEPS)
  }
  return { places: parameters.map((parameter) => [value(xs, mx, parameter), value(ys, my, parameter)]), parameters }
}

/** Of the spline through values at distances `h`: the solution of a cyclic system of equations by Jacobi's method. */
function secondDerivatives(values: Float64Array, h: Float64Array): Float64Array {
  const n = values.length
  const slope = values.map((value, i) => (values[(i + 1) % n] - value) / h[i])
  const right = slope.map((value, i) => 6 * (value - slope[(i + n - 1) % n]))
  let [m, next] = [new Float64Array(n), new Float64Array(n)]
  for (let round = 0; round < ROUNDS; round++) {
    for (let i = 0; i < n; i++) {
      const [before, after] = [i > 0 ? i - 1 : n - 1, i < n - 1 ? i + 1 : 0]
      next[i] = (right[i] - h[before] * m[before] - h[i] * m[after]) / (2 * (h[before] + h[i]))
    }
    ;[m, next] = [next, m]
  }
  return m
}

/** What is drawn of a track. */
export interface TrackShape {
  line: SmoothLine
  edges: [right: Point[], left: Point[]]
  faults: Fault[]
  /** Of the line [m]. */
  length: number
}

/** The shape of a track; it is computed once for each track, which panel and drawing then share. */
export function shapeOf(track: TrackLine): TrackShape {
  let shape = shapes.get(track)
  if (!shape) {
    const line = smoothLine(track.points)
    const { places } = line
    shape = { line, edges: edgesOf(places, track.width), faults: faultsOf(track, line), length: lengthOf(places) }
    shapes.set(track, shape)
  }
  return shape
}

const shapes = new WeakMap<TrackLine, TrackShape>()

/** The edges of a track along a line. */
export function edgesOf(places: readonly Point[], width: number): [right: Point[], left: Point[]] {
  const moved = (side: number): Point[] =>
    places.map(([x, y], i) => {
      const [a, b] = [places.at(i - 1) ?? [x, y], places[(i + 1) % places.length]]
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1
      const half = (0.5 * side * width) / length
      return [x - half * (b[1] - a[1]), y + half * (b[0] - a[0])]
    })
  return [moved(-1), moved(1)]
}

/** Where the track cannot be driven. */
export function faultsOf({ points, width }: Pick<TrackLine, 'points' | 'width'>, line = smoothLine(points)): Fault[] {
  const { places, parameters } = line
  const n = places.length
  const [radius, gap] = [0.5 * width + INNER_RADIUS, width + BETWEEN]
  const fault = (kind: Fault['kind'], i: number, value: number, least: number): Fault => {
    return { kind, at: places[i], point: Math.round(parameters[i]) % points.length, value, least }
  }
  const bends = places.map((place, i) => curvature(places[(i + n - 1) % n], place, places[(i + 1) % n]))
  const found = worst(bends, 1 / radius).map((i) => fault('bend', i, 1 / bends[i], radius))
  const apart = Math.ceil((1.7 * gap) / (lengthOf(places) / n))
  const { squares, others } = nearest(places, gap, apart)
  const touching = worst(
    squares.map((square) => -square),
    -gap * gap,
  )
  for (const i of touching) if (i < others[i]) found.push(fault('touch', i, Math.sqrt(squares[i]), gap))
  if (width < WIDTH_MIN) found.push({ kind: 'narrow', at: points[0], point: 0, value: width, least: WIDTH_MIN })
  return found.slice(0, MAX_FAULTS)
}

/** For each place of a closed line the nearest one within `gap` [m] that is at least `apart` places away: the square of
 * its distance (infinite: there is none) and its index.
 *
 * Only places in the same and in neighbouring squares of a grid are compared: with all of them this would be most of
 * the work while a point is dragged.
 */
function nearest(places: readonly Point[], gap: number, apart: number): { squares: Float64Array; others: Int32Array } {
  const n = places.length
  const cell = 1.001 * gap // rounding must not move a place across two squares
  const [xs, ys] = coordinates(places)
  const [columns, rows] = [xs, ys].map((values) => values.map((value) => Math.floor(value / cell)))
  // squares of the grid share the lists of a table; each list has the greatest index first
  const first = new Int32Array(4096).fill(-1)
  const next = new Int32Array(n)
  const list = (column: number, row: number): number =>
    (Math.imul(column, 73_856_093) ^ Math.imul(row, 19_349_663)) & (first.length - 1)
  for (let i = 0; i < n; i++) {
    const key = list(columns[i], rows[i])
    next[i] = first[key]
    first[key] = i
  }
  const squares = new Float64Array(n).fill(Infinity)
  const others = new Int32Array(n)
  const note = (i: number, other: number, square: number): void => {
    if (square > squares[i] || (square === squares[i] && other > others[i])) return
    ;[squares[i], others[i]] = [square, other]
  }
  for (let i = 0; i < n; i++)
    for (let column = columns[i] - 1; column <= columns[i] + 1; column++)
      for (let row = rows[i] - 1; row <= rows[i] + 1; row++)
        for (let other = first[list(column, row)]; other > i; other = next[other]) {
          if (other - i < apart || other - i > n - apart) continue
          const [dx, dy] = [xs[other] - xs[i], ys[other] - ys[i]]
          const square = dx * dx + dy * dy
          if (square >= gap * gap) continue
          note(i, other, square)
          note(other, i, square)
        }
  return { squares, others }
}

/** What is wrong, and what would be right. */
export function faultText({ kind, value, least }: Fault): string {
  const [is, should] = [`${value.toFixed(2)} m`, `${least.toFixed(2)} m`]
  if (kind === 'bend') return `Bend: the radius is ${is}; at least ${should} for this width`
  if (kind === 'touch') return `Two parts of the track are ${is} apart; at least ${should}`
  return `The track is ${is} wide; it should be at least ${should}`
}

/** Where a new point is inserted so that the line passes through `at`: after the point before the nearest place. */
export function insertedAt({ places, parameters }: SmoothLine, at: Point): { index: number; gap: number } {
  const gaps = places.map((place) => distance(place, at))
  const gap = Math.min(...gaps)
  return { index: Math.floor(parameters[gaps.indexOf(gap)]) + 1, gap }
}

export function lengthOf(places: readonly Point[]): number {
  return lengths(...coordinates(places))[places.length]
}

function coordinates(places: readonly Point[]): [xs: Float64Array, ys: Float64Array] {
  const [xs, ys] = [new Float64Array(places.length), new Float64Array(places.length)]
  for (let i = 0; i < places.length; i++) [xs[i], ys[i]] = places[i] // `from` of typed arrays is much slower
  return [xs, ys]
}

/** Distance of each place from the first one along the closed line [m], and the whole length. */
function lengths(xs: Float64Array, ys: Float64Array): Float64Array {
  const n = xs.length
  const found = new Float64Array(n + 1)
  for (let i = 0; i < n; i++) {
    const j = i < n - 1 ? i + 1 : 0
    const [dx, dy] = [xs[j] - xs[i], ys[j] - ys[i]]
    found[i + 1] = found[i] + Math.sqrt(dx * dx + dy * dy)
  }
  return found
}

/** Of the circle through three points [1/m]. */
function curvature(a: Point, b: Point, c: Point): number {
  const cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
  return (2 * Math.abs(cross)) / (distance(a, b) * distance(b, c) * distance(a, c))
}

/** Of each run of a closed line above a limit, the place with the greatest value. */
function worst(values: readonly number[] | Float64Array, limit: number): number[] {
  const n = values.length
  const isAbove = (i: number): boolean => values[i % n] > limit
  if (values.every((_, i) => isAbove(i))) return [values.indexOf(Math.max(...values))]
  const found: number[] = []
  for (let start = 0; start < n; start++) {
    if (!isAbove(start) || isAbove(start + n - 1)) continue
    let best = start
    for (let i = start; isAbove(i); i++) if (values[i % n] > values[best]) best = i % n
    found.push(best)
  }
  return found
}

function distance(a: Point, b: Point): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]]
  return Math.sqrt(dx * dx + dy * dy)
}
