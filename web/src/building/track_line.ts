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
  const axes = [0, 1].map((k) => points.map((point) => point[k]))
  const h = points.map((point, i) => Math.sqrt(distance(point, points[(i + 1) % n])))
  const before = (i: number): number => (i + n - 1) % n
  const second = axes.map((values) => {
    const slope = values.map((value, i) => (values[(i + 1) % n] - value) / h[i])
    const right = slope.map((value, i) => 6 * (value - slope[before(i)]))
    let m = values.map(() => 0)
    for (let round = 0; round < ROUNDS; round++)
      m = m.map(
        (_, i) => (right[i] - h[before(i)] * m[before(i)] - h[i] * m[(i + 1) % n]) / (2 * (h[before(i)] + h[i])),
      )
    return m
  })
  const at = (parameter: number): Point => {
    const i = Math.min(Math.floor(parameter), n - 1)
    const j = (i + 1) % n
    const t = (parameter - i) * h[i]
    const r = h[i] - t
    const value = (k: 0 | 1): number => {
      const [p, m] = [axes[k], second[k]]
      const cubic = (m[i] * (r * r * r) + m[j] * (t * t * t)) / (6 * h[i])
      return cubic + (p[i] / h[i] - (m[i] * h[i]) / 6) * r + (p[j] / h[i] - (m[j] * h[i]) / 6) * t
    }
    return [value(0), value(1)]
  }
  const fine = Array.from({ length: n * STEPS }, (_, k) => at(k / STEPS))
  const along = lengths(fine)
  const length = along[fine.length]
  const count = Math.min(Math.max(Math.round(length / SPACING), MIN_PLACES), MAX_PLACES)
  const parameters: number[] = []
  for (let k = 0, i = 0; k < count; k++) {
    const wanted = k * (length / count)
    while (i < fine.length - 1 && along[i + 1] <= wanted) i++
    parameters.push((i + (wanted - along[i]) / (along[i + 1] - along[i])) / STEPS)
  }
  return { places: parameters.map(at), parameters }
}

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
  const apart = Math.ceil((1.7 * gap) / (lengths(places)[n] / n))
  // each pair once, in plain arrays: this is most of the work while a point is dragged
  const [xs, ys] = [0, 1].map((k) => Float64Array.from(places, (place) => place[k]))
  const squares = new Float64Array(n).fill(Infinity)
  const others = new Int32Array(n)
  for (let i = 0; i < n; i++)
    for (let other = i + apart; other <= Math.min(i + n - apart, n - 1); other++) {
      const [dx, dy] = [xs[other] - xs[i], ys[other] - ys[i]]
      const square = dx * dx + dy * dy
      if (square < squares[i]) [squares[i], others[i]] = [square, other]
      if (square < squares[other]) [squares[other], others[other]] = [square, i]
    }
  const touching = worst(
    Array.from(squares, (square) => -square),
    -gap * gap,
  )
  for (const i of touching) if (i < others[i]) found.push(fault('touch', i, Math.sqrt(squares[i]), gap))
  if (width < WIDTH_MIN) found.push({ kind: 'narrow', at: points[0], point: 0, value: width, least: WIDTH_MIN })
  return found.slice(0, MAX_FAULTS)
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
  return lengths(places)[places.length]
}

/** Distance of each place from the first one along the closed line [m], and the whole length. */
function lengths(places: readonly Point[]): number[] {
  const found = [0]
  for (let i = 0; i < places.length; i++) found.push(found[i] + distance(places[i], places[(i + 1) % places.length]))
  return found
}

/** Of the circle through three points [1/m]. */
function curvature(a: Point, b: Point, c: Point): number {
  const cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
  return (2 * Math.abs(cross)) / (distance(a, b) * distance(b, c) * distance(a, c))
}

/** Of each run of a closed line above a limit, the place with the greatest value. */
function worst(values: readonly number[], limit: number): number[] {
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
