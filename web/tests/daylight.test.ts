import { describe, expect, it } from 'vitest'

import {
  type Daylight,
  daylight,
  effectsOf,
  extinction,
  inWeather,
  isBright,
  lookAt,
  skyColour,
  sunTimes,
} from '../src/scene/daylight'

const look = (exposure: number, sun_direction: number[]): Daylight => {
  const colour = [exposure, 0, 0]
  const light = { sun_color: colour, zenith: colour, horizon: colour, floor_glow: colour, dawn: colour }
  return { sun_direction, sun_place: sun_direction, ...light, exposure, glow: 0, dusk: exposure / 10 }
}
const night = look(9, [0, 0, 1])
const [low, high] = [look(2, [1, 0, 0]), look(4, [0.96, 0.28, 0])]
const table = { day: look(1, [0, 0, 1]), night, minutes: [night, low, high, night] }

describe('daylight', () => {
  it('is the light of day or night without a time of day', () => {
    expect(daylight(table, true, null)).toBe(table.day)
    expect(daylight(table, false, 900)).toBe(night)
  })

  it('lies between two entries of the table, in steps of a minute', () => {
    const { exposure, sun_direction } = daylight(table, true, 60 * 15 + 59)
    expect(exposure).toBe(3)
    expect(sun_direction[0]).toBeCloseTo(0.98 / Math.hypot(0.98, 0.14))
    expect(sun_direction[1]).toBeCloseTo(0.14 / Math.hypot(0.98, 0.14))
  })

  it('is bright by the fixed light of the day and by a sun of more than 8 degrees', () => {
    // as in `look.py`: a lower sun shines as if it were 8 degrees high, but its dusk goes on
    const at = (degrees: number): Daylight => {
      const high = Math.sin((Math.max(degrees, 8) * Math.PI) / 180)
      return { ...look(2, [1, 0, high]), dusk: Math.min(Math.max(1 - degrees / 16, 0), 1) }
    }
    const minutes = [night, at(2), at(7.9), at(8.1), at(60), night]
    const day = { day: look(1, [0, 0, 0]), night, minutes }
    const bright = minutes.map((_, i) => isBright(day, i > 0 && i < 5, 600 * i))
    expect(bright).toEqual([false, false, false, true, true, false])
    expect([isBright(day, true, null), isBright(day, false, null)]).toEqual([true, false])
  })

  it('does not mix in the night at sunrise and sunset', () => {
    const [rise, set] = [daylight(table, true, 60 * 5), daylight(table, true, 60 * 25)]
    expect(rise).toMatchObject({ exposure: low.exposure, sun_color: low.sun_color })
    expect(set).toMatchObject({ exposure: high.exposure, sun_color: high.sun_color })
  })

  it('shows the dawn before sunrise', () => {
    const dusk = { ...night, dawn: [2, 1, 0] }
    const [first, later] = [0, 5].map((minute) => {
      return daylight({ ...table, minutes: [night, dusk, low, high] }, false, 60 * minute)
    })
    expect(first.dawn).toEqual(night.dawn)
    expect(later.dawn[1]).toBeCloseTo(0.5)
    expect(later.exposure).toBe(night.exposure)
  })
})

describe('a dial', () => {
  it('knows sunrise and sunset from the table, and the light between them', () => {
    expect(sunTimes(table)).toEqual([0, 30])
    expect(lookAt(table, 60 * 15).exposure).toBe(3)
    expect(lookAt(table, 0)).toMatchObject({ exposure: night.exposure })
  })

  it('has the sRGB colour of the sky, and a grey of the same ratio for too much light', () => {
    const of = (zenith: number[]) => ({ ...night, zenith, horizon: zenith, dawn: [0, 0, 0], exposure: Math.PI })
    expect(skyColour(of([0.5, 0.2140411, 0]))).toBe('rgb(188 128 0)') // the sRGB standard: 0.2140 is 0.5
    const [red, green, blue] = skyColour(of([9, 9, 9])).match(/\d+/g) ?? []
    expect([green, blue]).toEqual([red, red])
    expect(Number(red)).toBeGreaterThan(250)
  })
})

describe('weather', () => {
  const clear = { clouds: 0, fog: 0, rain: 0, snow: 0, wind: 0, wetness: 0, snow_cover: 0 }

  it('dims the sun and makes the sky grey, as `look.in_air` of the simulator', () => {
    const day = { ...look(1, [0, 0, 1]), sun_color: [4.1, 3.85, 3.45], zenith: [1.35, 1.75, 2.35] }
    expect(inWeather(day, null)).toBe(day)
    const dull = inWeather(day, { ...clear, clouds: 0.5 })
    // in_air(DAY, Air(clouds=0.5)) of the simulator
    expect(dull.sun_color[0]).toBeCloseTo(2.1935, 6)
    expect(dull.zenith).toEqual([1.50625, 1.70625, 2.00625].map((one) => expect.closeTo(one, 6)))
    expect(inWeather(day, { ...clear, rain: 1 }).sun_color[0]).toBeCloseTo(4.1 * (1 - 0.93 * 0.8), 6)
  })

  it('sets the flags of the shaders for what can be seen', () => {
    expect(effectsOf(null, Infinity, 0)).toEqual([])
    expect(effectsOf(null, Infinity, 0.5)).toEqual(['WINDOWS'])
    expect(effectsOf({ ...clear, wetness: 0.5 }, 1186, 0)).toEqual(['WET']) // the air is nearly clear
    expect(effectsOf({ ...clear, snow_cover: 1 }, 8, 0.4)).toEqual(['AIR', 'SNOW'])
    expect(extinction(Infinity)).toBe(0)
    expect(Math.exp(-extinction(20) * 20)).toBeCloseTo(0.05)
  })
})
