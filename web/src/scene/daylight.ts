// The light of a scene by day, by night, at a time of day, and under clouds.

import type { Weather } from '../messages'

/** Sun or moon, sky and exposure; as `Daylight` of the simulator. */
export interface Daylight {
  sun_direction: number[]
  sun_color: number[]
  zenith: number[]
  horizon: number[]
  floor_glow: number[]
  exposure: number
  glow: number
  sun_place: number[]
  dawn: number[]
  /** From 0 by day to 1 by night. */
  dusk: number
}

/** Extinction [1/m] below which air is drawn as clear; as in `look.py`. */
const LEAST_EXTINCTION = 0.005

/** `Daylight.dusk` from which on lamps and the first windows are lit, and by clouds; as in `look.py`. */
export const LAMPS_LIT = 0.5
const WINDOWS_LIT = 0.45
const CLOUD_DUSK = 0.65

/** What surfaces and sky show of weather and dusk, as flags of the shaders. */
export function effectsOf(weather: Weather | null, sight: number, dusk: number): string[] {
  const found = {
    AIR: weather && extinction(sight) > LEAST_EXTINCTION,
    WET: weather?.wetness,
    SNOW: weather?.snow_cover,
    WINDOWS: dusk > WINDOWS_LIT,
  }
  return Object.entries(found)
    .filter(([, isSet]) => isSet)
    .map(([name]) => name)
}

/** Extinction of the air [1/m]; the sight [m] is infinite in clear air. */
export function extinction(sight: number): number {
  return Math.log(20) / sight
}

/** Share of clouds; rain, snow and fog come with clouds. */
export function cloudsOf(weather: Weather | null): number {
  return weather ? Math.max(weather.clouds, 0.8 * weather.rain, 0.7 * weather.snow, 0.7 * weather.fog) : 0
}

/** That light under clouds, as `in_air` of the simulator: less sun, and a grey sky. */
export function inWeather(look: Daylight, weather: Weather | null): Daylight {
  if (!weather) return look
  const clouds = cloudsOf(weather)
  const grey = ([red, green, blue]: number[], factor: number) => {
    const mean = factor * (0.3 * red + 0.5 * green + 0.2 * blue)
    return [red, green, blue].map((one) => one + clouds * (mean - one))
  }
  const snow = weather.snow_cover ?? 0
  return {
    ...look,
    sun_color: look.sun_color.map((one) => (1 - 0.93 * clouds) * one),
    zenith: grey(look.zenith, 0.95),
    horizon: grey(look.horizon, 0.9),
    floor_glow: grey(look.floor_glow, 0.8),
    dawn: grey(look.dawn, 0.3),
    dusk: Math.min(look.dusk + CLOUD_DUSK * clouds, 1),
    exposure: look.exposure * (1 - snow * (0.15 + 0.4 * Math.max(0, 1 - 2 * look.zenith[1]))),
  }
}

/** `light_table` of a Scene: 'minutes' has one look for each ten minutes of a day. */
interface Table {
  day: Daylight
  night: Daylight
  minutes: Daylight[]
}

/** The light; `timeOfDay` [s since midnight] in steps of a minute, null if the light is fixed. */
export function daylight(table: Record<string, unknown>, isDay: boolean, timeOfDay: number | null): Daylight {
  const { day, night, minutes } = table as unknown as Table
  if (timeOfDay === null) return isDay ? day : night
  const place = Math.floor(timeOfDay / 60) / 10
  const [low, high] = [Math.floor(place), Math.floor(place) + 1].map((i) => minutes[i % minutes.length])
  const between = mixed(low, high, place - Math.floor(place))
  const nights = [low, high].filter((one) => isSame(one, night)).length
  if (!isDay) return nights === 2 ? between : night // in the dusk only the sky differs from the night
  // at sunrise and sunset one of them is the night
  const { dawn, dusk, sun_place } = between
  return nights === 1 ? { ...(isSame(low, night) ? high : low), dawn, dusk, sun_place } : between
}

/** Whether there is light to work by: that of the day, or of a sun of 8 degrees or more, from which on lamps are off. */
export function isBright(table: Record<string, unknown>, isDay: boolean, timeOfDay: number | null): boolean {
  return isDay && (timeOfDay === null || daylight(table, isDay, timeOfDay).dusk < LAMPS_LIT)
}

/** The light at a time of day [s since midnight]. */
export function lookAt(table: Record<string, unknown>, timeOfDay: number): Daylight {
  const [rise, set] = sunTimes(table)
  return daylight(table, timeOfDay > 60 * rise && timeOfDay < 60 * set, timeOfDay)
}

/** Sunrise and sunset [min since midnight]. */
export function sunTimes(table: Record<string, unknown>): [number, number] {
  const { minutes, night } = table as unknown as Table
  const days = minutes.flatMap((one, i) => (isSame(one, night) ? [] : [10 * i]))
  return [days[0] - 10, days[days.length - 1] + 10] // at both of them the light is that of the night
}

/** CSS colour of the sky half-way up, as the shaders show it (`shown` in tone.glsl). */
export function skyColour({ zenith, horizon, dawn, exposure }: Daylight): string {
  const light = zenith.map((one, i) => exposure * (0.5 * 0.31831 * (one + horizon[i]) + 0.6 * dawn[i]))
  const peak = Math.max(...light)
  const bright = peak < 0.76 ? peak : 1 - 0.24 ** 2 / (peak + 0.24 - 0.76)
  const share = peak < 0.76 ? 0 : 1 - 1 / (0.15 * (peak - bright) + 1)
  const bytes = light.map((one) => {
    const c = (one * bright) / Math.max(peak, 1e-4)
    const pressed = c + share * (bright - c)
    return Math.round(255 * (pressed <= 0.0031308 ? 12.92 * pressed : 1.055 * pressed ** (1 / 2.4) - 0.055))
  })
  return `rgb(${bytes.join(' ')})`
}

function isSame(a: Daylight, b: Daylight): boolean {
  return a.exposure === b.exposure
}

function mixed(a: Daylight, b: Daylight, share: number): Daylight {
  const number = (x: number, y: number) => x + share * (y - x)
  const vector = (x: number[], y: number[]) => x.map((value, i) => number(value, y[i]))
  const direction = (x: number[], y: number[]) => {
    if (x[0] * y[0] + x[1] * y[1] + x[2] * y[2] < 0.9) return x // from the sun to the moon
    const sum = vector(x, y)
    return sum.map((value) => value / Math.hypot(...sum))
  }
  return {
    sun_direction: direction(a.sun_direction, b.sun_direction),
    sun_place: direction(a.sun_place, b.sun_place),
    dawn: vector(a.dawn, b.dawn),
    sun_color: vector(a.sun_color, b.sun_color),
    zenith: vector(a.zenith, b.zenith),
    horizon: vector(a.horizon, b.horizon),
    floor_glow: vector(a.floor_glow, b.floor_glow),
    exposure: number(a.exposure, b.exposure),
    glow: number(a.glow, b.glow),
    dusk: number(a.dusk, b.dusk),
  }
}
