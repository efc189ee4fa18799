// Names and icons of the weathers, for the bar and the menu.
import type { Weather } from '../messages'
import { WEATHERS } from '../messages'
import * as icons from './icons'

export const AMOUNTS = ['clouds', 'fog', 'rain', 'snow', 'wind'] as const

const ICONS: Record<string, string> = {
  ...{ sunny: icons.SUN, cloudy: icons.CLOUD, light_fog: icons.LIGHT_FOG, heavy_fog: icons.HEAVY_FOG },
  ...{ light_rain: icons.LIGHT_RAIN, heavy_rain: icons.HEAVY_RAIN },
  ...{ light_snow: icons.LIGHT_SNOW, heavy_snow: icons.HEAVY_SNOW },
}

/** The icon of a weather, by its name. */
export function weatherIcon(name: string): string {
  return ICONS[name] ?? icons.CLOUD
}

/** 'light_rain' as 'Light rain'. */
export function weatherTitle(name: string): string {
  const text = name.replace('_', ' ')
  return text.charAt(0).toUpperCase() + text.slice(1)
}

/** The name of the weather that has these amounts; '' if there is none. */
export function weatherName(weather: Weather): string {
  const isSame = (preset: Weather) => AMOUNTS.every((name) => Math.abs(preset[name] - weather[name]) < 1e-6)
  return Object.entries(WEATHERS).find(([, preset]) => isSame(preset))?.[0] ?? ''
}
