import { describe, expect, it } from 'vitest'

import { type Daylight, daylight } from '../src/scene/daylight'

const look = (exposure: number, sun_direction: number[]): Daylight => {
  const colour = [exposure, 0, 0]
  return { sun_direction, sun_color: colour, zenith: colour, horizon: colour, floor_glow: colour, exposure, glow: 0 }
}
const night = look(9, [0, 0, 1])
const [low, high] = [look(2, [1, 0, 0]), look(4, [0, 1, 0])]
const table = { day: look(1, [0, 0, 1]), night, minutes: [night, low, high, night] }

describe('daylight', () => {
  it('is the light of day or night without a time of day', () => {
    expect(daylight(table, true, null)).toBe(table.day)
    expect(daylight(table, false, 900)).toBe(night)
  })

  it('lies between two entries of the table, in steps of a minute', () => {
    const { exposure, sun_direction } = daylight(table, true, 60 * 15 + 59)
    expect(exposure).toBe(3)
    expect(sun_direction[0]).toBeCloseTo(Math.SQRT1_2)
    expect(sun_direction[1]).toBeCloseTo(Math.SQRT1_2)
  })

  it('does not mix in the night at sunrise and sunset', () => {
    expect(daylight(table, true, 60 * 5)).toBe(low)
    expect(daylight(table, true, 60 * 25)).toBe(high)
  })
})
