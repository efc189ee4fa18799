// Weather and time of day: presets with an intensity, single amounts, and what the weather means in numbers.

import type { Actions } from '../actions'
import type { Frame, Weather, WeatherEffects } from '../messages'
import { WEATHERS } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { choice, labelled, section, setOptions } from './fields'

const AMOUNTS = ['clouds', 'fog', 'rain', 'snow', 'wind'] as const
const GROUND = ['wetness', 'snow_cover'] as const
/** Of the presets 'light_rain', 'heavy_rain' and their like, the one whose amounts the intensity multiplies. */
const KINDS = ['sunny', 'cloudy', 'heavy_fog', 'heavy_rain', 'heavy_snow'] as const
const OWN = 'own'
/** Step of the time of day [min]. */
const STEP = 5
const MINUTES = 24 * 60
/** A slider shows what the user has set for so long [ms]. */
const REST = 700

export function weather(store: Store, actions: Actions): HTMLElement {
  const numbers = h('p', { class: 'note', testid: 'weather-numbers', role: 'status' })
  const kinds = choice('weather', (kind) => kind !== OWN && set(scaled(kind, 1)))
  const names = [...Object.keys(WEATHERS), OWN].map((name) => [name, title(name)])
  setOptions(kinds, Object.fromEntries(names))
  const intensity = slider('weather-intensity', 1, 0.05, (value) => set(scaled(kindOf(current), value), true))
  const amounts = AMOUNTS.map((name) => ({
    name,
    input: slider(`weather-${name}`, 1, 0.05, (value) => set({ ...current, [name]: value }, true)),
  }))
  const clockText = h('span', { class: 'state', testid: 'time-of-day-text' })
  const clock = slider('time-of-day', MINUTES - STEP, STEP, (minutes) => {
    void actions.request({ type: 'SetTimeOfDay', time: 60 * minutes })
  })
  let current: Weather = WEATHERS.sunny

  /** Sets a weather; only a preset ends a state of the ground that a script holds. */
  function set(wanted: Weather, keepsGround = false): void {
    current = wanted
    void actions.request({ type: 'SetWeather', weather: wanted, ...(keepsGround && { keeps_ground: true }) })
  }

  function show(frame: Frame | null): void {
    const shown = frame?.weather ?? WEATHERS.sunny
    // the ground follows, unless it is held
    current = { ...shown, wetness: null, snow_cover: null }
    const preset = Object.entries(WEATHERS).find(([, one]) => AMOUNTS.every((name) => near(one[name], shown[name])))
    if (document.activeElement !== kinds) kinds.value = preset?.[0] ?? OWN
    showValue(intensity, share(shown), `${Math.round(100 * share(shown))} %`)
    intensity.disabled = kindOf(shown) === 'sunny'
    for (const { name, input } of amounts) showValue(input, shown[name], `${Math.round(100 * shown[name])} %`)
    setText(numbers, inNumbers(frame?.weather_effects ?? null, shown))
    const minutes =
      frame?.time_of_day == null ? (frame?.scene_light === false ? 0 : MINUTES / 2) : frame.time_of_day / 60
    showValue(clock, minutes, clockTime(minutes))
    setText(clockText, frame?.time_of_day == null ? '–' : clockTime(minutes))
  }

  store.frame.watch(show)
  const more = h(
    'details',
    { testid: 'weather-more' },
    h('summary', {}, 'More'),
    ...amounts.map(({ name, input }) => labelled(title(name), input)),
  )
  const element = section(
    'Weather',
    labelled('Weather', kinds),
    labelled('Intensity', intensity),
    labelled('Time of day', h('span', { class: 'slider' }, clock, clockText)),
    numbers,
    more,
  )
  element.classList.add('live') // it has no effect in a replay, which hides it
  return element
}

function slider(testid: string, max: number, step: number, choose: (value: number) => void): HTMLInputElement {
  const input = h('input', { type: 'range', testid, min: 0, max, step })
  input.addEventListener('input', () => {
    input.dataset.moved = String(performance.now())
    choose(Number(input.value))
  })
  return input
}

/** Shows a value, unless the user has just moved the slider: Frames with the new value come later. */
function showValue(input: HTMLInputElement, value: number, text: string): void {
  const isMoving = performance.now() - Number(input.dataset.moved ?? -REST) < REST
  if (!isMoving) input.value = String(value)
  if (input.getAttribute('aria-valuetext') !== text) input.setAttribute('aria-valuetext', text)
}

/** A preset of that kind with other amounts; 1 are those of the preset. */
function scaled(kind: string, intensity: number): Weather {
  const preset = WEATHERS[kind] ?? WEATHERS.sunny
  const factor = KINDS.includes(kind as (typeof KINDS)[number]) && kind !== 'sunny' ? intensity : 1
  const amounts = AMOUNTS.map((name) => [name, Math.min(1, preset[name] * factor)])
  return { ...preset, ...Object.fromEntries(amounts) }
}

/** The preset whose strongest amount is that of the weather. */
function kindOf(weather: Weather): string {
  if (weather.snow > 0 && weather.snow >= weather.rain) return 'heavy_snow'
  if (weather.rain > 0) return 'heavy_rain'
  if (weather.fog > 0) return 'heavy_fog'
  return weather.clouds > 0 ? 'cloudy' : 'sunny'
}

/** The intensity at which `scaled` makes that weather, at most 1. */
function share(weather: Weather): number {
  const kind = kindOf(weather)
  const name = ({ heavy_snow: 'snow', heavy_rain: 'rain', heavy_fog: 'fog' } as const)[kind] ?? 'clouds'
  const full = WEATHERS[kind][name]
  return full > 0 ? Math.min(1, weather[name] / full) : 0
}

function near(a: number, b: number): boolean {
  return Math.abs(a - b) < 1e-6
}

/** For example 'Grip 0.71, LIDAR 8.7 m at 10 % reflectivity, sight 18 m'. */
export function inNumbers(effects: WeatherEffects | null, weather: Weather): string {
  if (!effects) return 'Clear: full grip, full range, full sight'
  const parts = [`Grip ${effects.grip.toFixed(2)}`]
  if (effects.lidar_dark !== null) parts.push(`LIDAR ${effects.lidar_dark.toFixed(1)} m at 10 % reflectivity`)
  parts.push(effects.sight < 1000 ? `sight ${effects.sight.toFixed(0)} m` : 'sight more than 1000 m')
  for (const name of GROUND) {
    const value = weather[name] ?? 0
    if (value > 0) parts.push(`${title(name).toLowerCase()} ${Math.round(100 * value)} %`)
  }
  return parts.join(', ')
}

function clockTime(minutes: number): string {
  const whole = Math.round(minutes) % MINUTES
  return `${String(Math.floor(whole / 60)).padStart(2, '0')}:${String(whole % 60).padStart(2, '0')}`
}

function title(name: string): string {
  const text = name === OWN ? 'own amounts' : name.replace('_', ' ')
  return text.charAt(0).toUpperCase() + text.slice(1)
}
