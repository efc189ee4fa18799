// Weather and time of day: presets with an intensity, single amounts, a dial, and what the weather means in numbers.

import type { Actions } from '../actions'
import type { Frame, Weather, WeatherEffects } from '../messages'
import { WEATHERS } from '../messages'
import { inWeather, lookAt, skyColour, sunTimes } from '../scene/daylight'
import type { Store } from '../store'
import { DAY, dial } from './dial'
import { h, icon, setText } from './element'
import { labelled, row, section, segments, state } from './fields'
import { AMOUNTS, weatherIcon, weatherName, weatherTitle } from './weather_names'

const GROUND = ['wetness', 'snow_cover'] as const
/** Of the presets 'light_rain', 'heavy_rain' and their like, the one whose amounts the intensity multiplies. */
const KINDS = ['sunny', 'cloudy', 'heavy_fog', 'heavy_rain', 'heavy_snow'] as const
/** How fast the time of day passes: seconds of the day per simulated second. */
const SPEEDS = [
  ['0', 'Stop'],
  ['60', '1 min/s'],
  ['600', '10 min/s'],
  ['3600', '1 h/s'],
] as const
/** Colours of the ring of the dial. */
const COLOURS = 72
/** Least time between two requests for the lines of the weather [ms]. */
const PAUSE = 500
/** A slider shows what the user has set for so long [ms]. */
const REST = 700

export function weather(store: Store, actions: Actions): HTMLElement {
  const numbers = h('p', { class: 'note', testid: 'weather-numbers', role: 'status' })
  const lines = h('p', { class: 'note lines', testid: 'weather-lines', hidden: true })
  const presets = segments(
    'weather',
    'Weather',
    Object.keys(WEATHERS).map((name) => [name, '']),
    (name) => {
      set(scaled(name, 1))
    },
  )
  for (const button of presets.element.querySelectorAll('button')) {
    button.dataset.testid = `weather-${button.value}`
    button.title = weatherTitle(button.value)
    button.append(icon(weatherIcon(button.value)), h('span', {}, button.title))
  }
  presets.element.classList.add('presets')
  const intensity = slider('weather-intensity', 1, 0.05, (value) => set(scaled(kindOf(current), value), true))
  const amounts = AMOUNTS.map((name) => ({
    name,
    input: slider(`weather-${name}`, 1, 0.05, (value) => set({ ...current, [name]: value }, true)),
  }))
  let speed = 0
  const clock = dial((minutes) => {
    void actions.request({ type: 'SetTimeOfDay', time: 60 * minutes, ...(speed && { scale: speed }) })
  })
  const speeds = segments('day-speed', 'Speed of the time of day', SPEEDS, (value) => {
    speed = Number(value)
    speeds.show(value)
    void actions.request({ type: 'SetTimeOfDay', time: null, scale: speed })
  })
  let before: Frame | null = null
  let seen = ''
  let painted = ''
  let described = ''
  let askedAt = -PAUSE
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
    presets.show(weatherName(shown))
    showValue(intensity, share(shown), `${Math.round(100 * share(shown))} %`)
    intensity.disabled = kindOf(shown) === 'sunny'
    for (const { name, input } of amounts) showValue(input, shown[name], `${Math.round(100 * shown[name])} %`)
    setText(numbers, inNumbers(frame?.weather_effects ?? null, shown))
    const time = frame?.time_of_day ?? null
    const isNight = frame?.scene_light === false
    if (time === null) clock.show(isNight ? 0 : DAY / 2, isNight ? 'Night' : 'Day')
    else clock.show(time / 60)
    showSpeed(frame)
    describe(frame)
    paint()
  }

  /** Shows the lines of `autodrive weather`, which the simulator makes, after each change of the weather. */
  function describe(frame: Frame | null): void {
    const state = frame?.weather ? `${inNumbers(frame.weather_effects, frame.weather)} ${frame.scene_light}` : ''
    if (!state) lines.hidden = true
    if (state === described || performance.now() - askedAt < PAUSE || !store.isMenuOpen.value) return
    described = state
    if (!state || store.status.value?.position != null) return // a replay has no simulation
    askedAt = performance.now()
    void actions.attempt({ type: 'DescribeWeather' }).then(({ text }) => {
      setText(lines, text ?? '')
      lines.hidden = !text
    })
  }

  /** Shows how fast the time of day passes, from Frames: another client may have set it. */
  function showSpeed(frame: Frame | null): void {
    const passed = frame && before ? frame.time - before.time : -1
    if (passed >= 0 && passed < 0.2) return
    const value = frame && before && passed > 0 ? speedOf(frame, before) : ''
    before = frame
    if (value === seen) {
      // twice: a time that the user sets is no speed
      speed = Number(value)
      speeds.show(value)
    }
    seen = value
  }

  /** Paints the ring of the dial with the sky of the scene, in its weather. */
  function paint(): void {
    const table = store.scene.value?.light_table
    const key = `${store.scene.value?.scenario} ${AMOUNTS.map((name) => current[name])}`
    if (!table?.minutes || key === painted) return // old recordings have no table
    painted = key
    const times = Array.from({ length: COLOURS + 1 }, (_, i) => (60 * DAY * i) / COLOURS)
    clock.paint(times.map((time) => skyColour(inWeather(lookAt(table, time), current))))
    clock.mark(...sunTimes(table))
  }

  const light = state('scene-light-status')
  const lightButton = h('button', { testid: 'scene-light', onclick: () => actions.toggleSceneLight() }, 'Scene Light')
  store.frame.watch((frame) => {
    setText(light, frame ? (frame.scene_light ? 'On' : 'Off') : '–')
    lightButton.setAttribute('aria-pressed', String(frame?.scene_light ?? false))
  })
  store.frame.watch(show)
  const more = h(
    'details',
    { testid: 'weather-more' },
    h('summary', {}, 'More'),
    ...amounts.map(({ name, input }) => labelled(weatherTitle(name), input)),
  )
  const element = section(
    'Weather',
    presets.element,
    labelled('Intensity', intensity),
    h(
      'div',
      { class: 'day' },
      clock.element,
      h('div', { class: 'named' }, h('span', {}, 'Time passes'), speeds.element),
    ),
    row(lightButton, light),
    numbers,
    lines,
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

/** The one of SPEEDS at which the time of day passed between two Frames; '' if it is another one. */
function speedOf(frame: Frame, before: Frame): string {
  const [start, end] = [before.time_of_day ?? 0, frame.time_of_day ?? 0]
  const change = end - start + (end < start - 30 * DAY ? 60 * DAY : 0) // after midnight
  const rate = frame.time_of_day === null ? 0 : change / (frame.time - before.time)
  return SPEEDS.find(([value]) => Math.abs(rate - Number(value)) <= Math.max(1, 0.1 * Number(value)))?.[0] ?? ''
}

/** For example 'Grip of the tyres 0.71 of that on dry ground, LIDAR 8 m at 10 % and 12 m at 80 % reflectivity, sight 18 m'. */
export function inNumbers(effects: WeatherEffects | null, weather: Weather): string {
  if (!effects) return 'Clear: the tyres have full grip, the LIDAR has its full range, the sight is full'
  const parts = [`Grip of the tyres ${effects.grip.toFixed(2)} of that on dry ground`]
  const ranges = [effects.lidar_dark, effects.lidar_bright].map((range) => range?.toFixed(1))
  if (effects.lidar_dark !== null) parts.push(`LIDAR ${ranges[0]} m at 10 % and ${ranges[1]} m at 80 % reflectivity`)
  parts.push(effects.sight < 1000 ? `sight ${effects.sight.toFixed(0)} m` : 'sight more than 1000 m')
  for (const name of GROUND) {
    const value = weather[name] ?? 0
    if (value > 0) parts.push(`${weatherTitle(name).toLowerCase()} ${Math.round(100 * value)} %`)
  }
  return parts.join(', ')
}
