// The light of a scene by day, by night and at a time of day.

/** Sun or moon, sky and exposure; as `Daylight` of the simulator. */
export interface Daylight {
  sun_direction: number[]
  sun_color: number[]
  zenith: number[]
  horizon: number[]
  floor_glow: number[]
  exposure: number
  glow: number
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
  if (!isDay) return night
  if (timeOfDay === null) return day
  const place = Math.floor(timeOfDay / 60) / 10
  const [low, high] = [Math.floor(place), Math.floor(place) + 1].map((i) => minutes[i % minutes.length])
  // at sunrise and sunset one of them is the night
  if (isSame(low, night)) return high
  return isSame(high, night) ? low : mixed(low, high, place - Math.floor(place))
}

function isSame(a: Daylight, b: Daylight): boolean {
  return a.exposure === b.exposure
}

function mixed(a: Daylight, b: Daylight, share: number): Daylight {
  const number = (x: number, y: number) => x + share * (y - x)
  const vector = (x: number[], y: number[]) => x.map((value, i) => number(value, y[i]))
  const direction = vector(a.sun_direction, b.sun_direction)
  return {
    sun_direction: direction.map((value) => value / Math.hypot(...direction)),
    sun_color: vector(a.sun_color, b.sun_color),
    zenith: vector(a.zenith, b.zenith),
    horizon: vector(a.horizon, b.horizon),
    floor_glow: vector(a.floor_glow, b.floor_glow),
    exposure: number(a.exposure, b.exposure),
    glow: number(a.glow, b.glow),
  }
}
