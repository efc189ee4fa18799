// The track that is drawn while a point is dragged: the same line and faults as in the simulator.
import { expect, test } from 'vitest'
import { edgesOf, faultsOf, faultText, insertedAt, lengthOf, shapeOf, smoothLine } from '../src/building/track_line'
import type { Point } from '../src/editing/outline'
import lines from './track_lines.json'

const CIRCLE = Array.from({ length: 8 }, (_, i): [number, number] => {
  return [5 * Math.cos((i * Math.PI) / 4), 5 * Math.sin((i * Math.PI) / 4)]
})

test('line and faults of random tracks are those of the simulator', () => {
  const kinds = new Set<string>()
  for (const { points, width, count, places, faults } of lines) {
    const line = smoothLine(points as unknown as Point[])
    expect(line.places.length).toBe(count)
    places.forEach(([x, y], i) => {
      expect(line.places[25 * i]).toEqual([expect.closeTo(x, 8), expect.closeTo(y, 8)])
    })
    const found = faultsOf({ points: points as [number, number][], width }, line)
    const expected = faults as [string, number, number, number, number, number][]
    expect(found.map(({ kind, point }) => [kind, point])).toEqual(expected.map(([kind, , , point]) => [kind, point]))
    found.forEach(({ kind, at, value, least }, i) => {
      const numbers = [expected[i][1], expected[i][2], expected[i][4], expected[i][5]]
      expect([at[0], at[1], value, least]).toEqual(numbers.map((number) => expect.closeTo(number, 6)))
      kinds.add(kind)
    })
  }
  expect([...kinds].sort()).toEqual(['bend', 'narrow', 'touch'])
})

test('the line through points of a circle is a circle, and its edges are half a width away', () => {
  const { places } = smoothLine(CIRCLE)
  const radii = (points: Point[]): number[] => points.map(([x, y]) => Math.hypot(x, y))
  for (const radius of radii(places)) expect(radius).toBeCloseTo(5, 1)
  const [right, left] = edgesOf(places, 1)
  for (const radius of radii(right)) expect(radius).toBeCloseTo(5.5, 1)
  for (const radius of radii(left)) expect(radius).toBeCloseTo(4.5, 1)
  expect(lengthOf(places)).toBeCloseTo(10 * Math.PI, 1)
})

test('a point is inserted between its neighbours', () => {
  const line = smoothLine(CIRCLE)
  const between = line.places[line.parameters.findIndex((parameter) => parameter > 2.5)]
  expect(insertedAt(line, between)).toEqual({ index: 3, gap: 0 })
  const last = line.places.at(-2) as Point
  expect(insertedAt(line, last).index).toBe(8)
})

test('a fault says what is wrong and what would be right', () => {
  const [fault] = faultsOf({ points: CIRCLE.map(([x, y]) => [x / 10, y / 10]), width: 1 })
  expect(fault.kind).toBe('bend')
  expect(faultText(fault)).toMatch(/radius is 0\.\d\d m; at least 0\.60 m/)
})

test('after each of many edits, the parts that touch are those of a comparison of all places', () => {
  let seed = 1
  const random = (): number => {
    seed = (seed * 48271) % 2147483647
    return seed / 2147483647
  }
  const points = Array.from({ length: 16 }, (_, i): [number, number] => {
    const angle = (2 * Math.PI * i) / 16
    return [3 * Math.cos(angle) + random(), 3 * Math.sin(angle) + random()]
  })
  let count = 0
  for (let edit = 0; edit < 100; edit++) {
    points[Math.floor(random() * points.length)] = [8 * random() - 4, 8 * random() - 4]
    const width = 0.2 + 0.6 * random()
    const { line, faults } = shapeOf({ points: points.map((point) => [...point]), width, barrier: 'wall' })
    const touching = touchingOf(line.places, width + 0.05)
    const found = faults.filter(({ kind }) => kind === 'touch').map(({ at, value }) => [at, value])
    const bends = faults.filter(({ kind }) => kind === 'bend').length
    expect(found).toEqual(touching.slice(0, 20 - bends))
    count += found.length
  }
  expect(count).toBeGreaterThan(100)
})

/** Of each run of places of a line that are too near to another part, the nearest one and its distance, once a pair. */
function touchingOf(places: readonly Point[], gap: number): [Point, number][] {
  const n = places.length
  const apart = Math.ceil((1.7 * gap) / (lengthOf(places) / n))
  const nearest = places.map(([x, y], i) => {
    let [other, least] = [-1, Infinity]
    for (let j = 0; j < n; j++) {
      const [dx, dy] = [places[j][0] - x, places[j][1] - y]
      const isApart = Math.abs(j - i) >= apart && Math.abs(j - i) <= n - apart
      if (isApart && dx * dx + dy * dy < least) [other, least] = [j, dx * dx + dy * dy]
    }
    return { other, least }
  })
  const isNear = (i: number): boolean => nearest[i % n].least < gap * gap
  expect(places.some((_, i) => !isNear(i))).toBe(true)
  const found: [Point, number][] = []
  for (let start = 0; start < n; start++) {
    if (!isNear(start) || isNear(start + n - 1)) continue
    let best = start
    for (let i = start; isNear(i); i++) if (nearest[i % n].least < nearest[best].least) best = i % n
    if (best < nearest[best].other) found.push([places[best], Math.sqrt(nearest[best].least)])
  }
  return found
}

test('the shape of a track is computed once', () => {
  const track = { points: CIRCLE, width: 1, barrier: 'wall' as const }
  expect(shapeOf(track)).toBe(shapeOf(track))
  expect(shapeOf({ ...track, width: 2 }).edges).not.toEqual(shapeOf(track).edges)
})
