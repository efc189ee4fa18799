import { describe, expect, test } from 'vitest'

import type { CollisionShapes } from '../src/messages'
import { scaleFor } from '../src/panels/scales'
import { ARROW } from '../src/scene/overlay_look'
import { arrow, outlines } from '../src/scene/overlay_view'
import { raised } from '../src/scene/strokes'

const TINT = [1, 0, 0, 1]

function shape(kind: number, size: number[], position = [0, 0, 0], rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]) {
  const [s, p, r] = [size, position, rotation].map((values) => new Float64Array(values))
  return { kind: new BigInt64Array([BigInt(kind)]), size: s, position: p, rotation: r } as CollisionShapes
}

/** The ends of all lines. */
function ends(shapes: CollisionShapes): number[][] {
  return outlines(shapes, TINT, () => true).flatMap(({ begin, end }) => [[...begin], [...end]])
}

describe('the outline of', () => {
  test('a box has its 12 edges, each as long as a side, and its 8 corners', () => {
    const all = outlines(shape(6, [1, 2, 3], [10, 0, 0]), TINT, () => true)
    const lengths = all.map(({ begin, end }) => Math.hypot(...begin.map((value, k) => value - end[k])))
    expect(lengths.sort((a, b) => a - b)).toEqual(
      [2, 2, 2, 2, 4, 4, 4, 4, 6, 6, 6, 6].map((one) => expect.closeTo(one)),
    )
    const corners = new Set(ends(shape(6, [1, 2, 3], [10, 0, 0])).map((point) => point.map((x) => x.toFixed(6)).join()))
    expect(corners.size).toBe(8)
    for (const corner of corners) {
      const [x, y, z] = corner.split(',').map(Number)
      expect([Math.abs(x - 10), Math.abs(y), Math.abs(z)]).toEqual([1, 2, 3])
    }
  })

  test('a turned box is turned: its x axis is the y axis of the map', () => {
    const turned = shape(6, [1, 2, 3], [0, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 1])
    expect(Math.max(...ends(turned).map(([x]) => x))).toBeCloseTo(2)
    expect(Math.max(...ends(turned).map(([, y]) => y))).toBeCloseTo(1)
  })

  test('a cylinder and a sphere lies on its surface', () => {
    for (const [x, y, z] of ends(shape(5, [0.5, 2, 0]))) {
      expect(Math.hypot(x, y)).toBeCloseTo(0.5)
      expect(Math.abs(z)).toBeCloseTo(2)
    }
    for (const point of ends(shape(2, [0.7, 0, 0]))) expect(Math.hypot(...point)).toBeCloseTo(0.7)
  })

  test('a shape that is not chosen is not drawn', () => {
    expect(outlines(shape(6, [1, 1, 1]), TINT, () => false)).toEqual([])
  })
})

describe('an arrow', () => {
  test('is as long as the legend says, along its force, with its head at the tip', () => {
    const [shaft, ...head] = arrow([1, 2, 3], [0, 0, 7], 5, TINT)
    expect([...shaft.begin]).toEqual([1, 2, 3])
    expect([...shaft.end]).toEqual([1, 2, expect.closeTo(3 + (ARROW * 7) / 5)])
    expect(head.length).toBe(4)
    for (const { begin } of head) expect([...begin]).toEqual([...shaft.end])
  })

  test('of a crash is not longer than half a metre, and without a force there is none', () => {
    const [shaft] = arrow([0, 0, 0], [1e6, 0, 0], 5, TINT)
    expect(shaft.end[0]).toBeCloseTo(0.5)
    expect(arrow([0, 0, 0], [0, 0, 0], 5, TINT)).toEqual([])
  })

  test.each([
    [4.3, 5],
    [0.9, 1],
    [1, 1],
    [12, 20],
    [51, 100],
    [0.03, 0.05],
  ])('forces of %f N have the scale %f N', (force, scale) => {
    expect(scaleFor(new Float64Array([force, 0, 0, 0, 0, force]))).toBeCloseTo(scale, 9)
  })

  test('without forces there is no scale', () => {
    expect(scaleFor(new Float64Array())).toBe(0)
    expect(scaleFor(new Float64Array(3))).toBe(0)
  })
})

describe('texts', () => {
  test('are moved up until none covers another, no further than needed, and the lowest stays', () => {
    const box = (x: number, y: number) => ({ x, y, wide: 2, high: 1 })
    expect(raised([box(0, 0), box(10, 0)])).toEqual([0, 0])
    expect(raised([box(0, 0.5), box(1, 0), box(0, 1)])).toEqual([0.75, 0, 1.5])
    expect(raised([])).toEqual([])
  })
})
