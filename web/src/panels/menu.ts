// The menu in three tabs: scenario, view and tools, programs. It has the controls of the report (table 13).

import type { Actions } from '../actions'
import { sentence } from '../actions'
import type { Connection } from '../connection'
import type { Observable } from '../observable'
import type { Scenarios } from '../scenarios'
import type { Quality, Store } from '../store'
import { bridge } from './bridge'
import { h, setText } from './element'
import { choice, labelled, row, section, segments, setOptions, state } from './fields'
import { clock, NONE } from './hud_rows'
import { busy, disableWhenRefused } from './pending'
import { loadPreference, savePreference } from './preferences'
import { rangeScale } from './range_scale'
import { tabs } from './tabs'
import type { Theme } from './theme'
import { savedTheme, setTheme } from './theme'
import { tools } from './tools'
import { trafficLights } from './traffic_lights'
import { weather } from './weather'

const QUALITIES: Record<Quality, string> = {
  auto: 'Automatic',
  low: 'Low',
  high: 'High',
  ultra: 'Ultra',
  stream: 'Stream',
}
/** Largest number of ticks that the simulator runs in one step. */
const MAX_TICKS = 10000
/** Speed: as fast as possible. */
const MAX = 'max'
const SPEEDS = [
  ['0.25', '¼'],
  ['0.5', '½'],
  ['1', '1'],
  ['2', '2'],
  ['4', '4'],
  [MAX, 'Max'],
] as const
const THEMES = [
  ['system', 'System'],
  ['light', 'Light'],
  ['dark', 'Dark'],
] as const

/** `recording` is the section that records; `showPrograms` shows programs that connect. */
export function menu(
  store: Store,
  connection: Connection,
  actions: Actions,
  recording: HTMLElement,
  showPrograms: () => void,
  scenarios: Scenarios,
): HTMLElement {
  const parts = {
    scenario: h(
      'div',
      {},
      scenario(store, scenarios),
      weather(store, actions),
      trafficLights(store, actions),
      time(store, actions),
    ),
    view: h('div', {}, view(store, actions), tools(store, actions), recording),
    programs: h('div', {}, bridge(store, connection, showPrograms)),
  }
  const { element, show } = tabs(
    'menu-tab',
    'Parts of the menu',
    [
      ['scenario', 'Scenario', parts.scenario],
      ['view', 'View and tools', parts.view],
      ['programs', 'Programs', parts.programs],
    ],
    (id) => savePreference('menu', id),
  )
  const panel = h(
    'aside',
    { class: 'panel menu', id: 'menu', testid: 'menu', 'aria-label': 'Menu' },
    element,
    ...Object.values(parts),
  )
  const known = loadPreference('menu') ?? ''
  show(known in parts ? known : 'scenario')
  let isReplay = false
  store.status.watch((status) => {
    const isReplayNow = status !== null && status.position !== null
    if (isReplayNow && !isReplay) show('view') // a replay has no scenario to choose and no program
    isReplay = isReplayNow
    element.hidden = isReplay
  })
  store.isMenuOpen.watch((isOpen) => (panel.hidden = !isOpen))
  return panel
}

/** Marks what has no effect in a replay, which hides it. */
function live(element: HTMLElement): HTMLElement {
  element.classList.add('live')
  return element
}

/** Simulated time; Reset sets it to 0. */
function timeText(store: Store): HTMLElement {
  const text = h('span', { class: 'state', testid: 'time' })
  store.frame.watch((frame) => {
    setText(text, clock(frame?.time ?? 0))
  })
  return text
}

function time(store: Store, actions: Actions): HTMLElement {
  const pause = h('button', { testid: 'pause', onclick: () => actions.togglePause() }, 'Pause')
  const error = h('p', { class: 'error', testid: 'ticks-error', id: 'ticks-error', role: 'alert', hidden: true })
  const label = { 'aria-label': 'Number of ticks per step', 'aria-describedby': 'ticks-error' }
  const enter = (event: KeyboardEvent) => event.key === 'Enter' && run()
  const listeners = { oninput: () => refuse(''), onkeydown: enter }
  const ticks = h('input', { testid: 'ticks', inputmode: 'numeric', value: 1, ...listeners, ...label })

  function refuse(text: string): void {
    showText(error, text)
    ticks.setAttribute('aria-invalid', String(text !== ''))
  }

  function run(): void {
    const text = ticks.value.trim()
    const isValid = /^\d+$/.test(text) && Number(text) >= 1 && Number(text) <= MAX_TICKS
    refuse(isValid ? '' : `Enter a whole number of ticks from 1 to ${MAX_TICKS}.`)
    if (isValid) void actions.step(Number(text))
    else ticks.focus()
  }

  const step = h(
    'button',
    { testid: 'step', title: 'Run this number of ticks, then pause (key {KeyN}: one tick)', onclick: run },
    'Step',
  )
  disableWhenRefused(store, step, 'Step')
  disableWhenRefused(store, pause, 'Pause')
  const speed = segments('speed', 'Speed', SPEEDS, (value) => {
    void actions.request({ type: 'SetSpeed', factor: value === MAX ? null : Number(value) })
  })
  store.status.watch((status) => {
    if (!status) return
    setText(pause, status.is_paused ? 'Resume' : 'Pause')
    pause.setAttribute('aria-pressed', String(status.is_paused))
    speed.show(status.speed === null ? MAX : String(status.speed))
  })
  const reset = h('button', { testid: 'reset', onclick: () => void busy(reset, () => actions.reset()) }, 'Reset')
  disableWhenRefused(store, reset, 'Reset')
  return section(
    'Time and driving',
    live(row(reset, timeText(store))),
    h('div', { class: 'steps' }, pause, step, ticks, h('span', { class: 'muted' }, 'ticks'), error),
    h('div', { class: 'labelled' }, h('span', {}, 'Speed'), speed.element),
    drivingMode(store, actions),
  )
}

function drivingMode(store: Store, actions: Actions): HTMLElement {
  const mode = state('mode-status')
  const button = h('button', { testid: 'mode', onclick: () => actions.toggleMode() }, 'Driving Mode')
  const show = () => {
    const isAutonomous = store.frame.value?.vehicles[store.vehicle.value]?.is_autonomous
    setText(mode, isAutonomous === undefined ? NONE : isAutonomous ? 'Autonomous' : 'Manual')
    button.setAttribute('aria-pressed', String(isAutonomous ?? false))
  }
  store.frame.watch(show)
  store.vehicle.watch(show)
  disableWhenRefused(store, button, 'SetDrivingMode')
  return live(row(button, mode))
}

function scenario(store: Store, scenarios: Scenarios): HTMLElement {
  const note = h('p', { class: 'note', testid: 'note', role: 'status', hidden: true })
  const error = h('p', { class: 'error', testid: 'scenario-error', role: 'alert', hidden: true })
  const select = choice('scenario', (name) => void scenarios.choose(name), { 'aria-label': 'Scenario' })
  const showAll = h(
    'button',
    { testid: 'all-scenarios', class: 'live', onclick: () => (store.isStartOpen.value = true) },
    'All scenarios',
  )
  for (const one of [select, showAll]) disableWhenRefused(store, one, 'LoadScenario')

  function show(): void {
    const { titles, loading } = scenarios
    const present = loading.value || store.scene.value?.scenario
    setOptions(select, present ? titles : { '': 'Loading…' }) // the first scenario of the list is not the present one
    select.disabled = loading.value !== '' || !present || 'LoadScenario' in store.refused.value
    if (present) select.value = present
    const activity = store.status.value?.note
    const isLoading = `Loading ${titles[loading.value] ?? loading.value}…`
    showText(note, loading.value ? isLoading : activity ? sentence(activity) : '')
  }

  for (const one of [store.welcome, store.files, store.scene, store.status, scenarios.loading])
    (one as Observable<unknown>).watch(show)
  scenarios.error.watch((text) => showText(error, text))
  return section('Scenario', select, showAll, note, error)
}

function showText(element: HTMLElement, text: string): void {
  setText(element, text)
  element.hidden = !text
}

function view(store: Store, actions: Actions): HTMLElement {
  const camera = state('camera-status')
  store.camera.watch((name) => setText(camera, name))
  const quality = choice('quality', (value) => (store.quality.value = value as Quality), {
    title: 'Quality of the 3D view. Stream: the simulator renders it and sends images',
  })
  setOptions(quality, QUALITIES)
  store.quality.watch((value) => (quality.value = value))
  const scan = h('input', { type: 'checkbox', testid: 'lidar', role: 'switch' })
  scan.addEventListener('change', () => (store.isScanShown.value = scan.checked))
  const scale = rangeScale('Range of the LIDAR points', store.scanFarthest)
  store.isScanShown.watch((isShown) => {
    scan.checked = isShown
    scale.hidden = !isShown
  })
  const theme = segments<Theme>('theme', 'Theme', THEMES, (value) => {
    setTheme(value)
    theme.show(value)
  })
  theme.show(savedTheme())
  return section(
    'View',
    vehicleField(store),
    row(h('button', { testid: 'camera', onclick: () => actions.nextCamera() }, 'Camera'), camera),
    labelled('Quality', quality),
    labelled('Show LIDAR scan', scan),
    scale,
    h('div', { class: 'labelled' }, h('span', {}, 'Theme'), theme.element),
  )
}

/** The list of the vehicles, if there are several. */
function vehicleField(store: Store): HTMLElement {
  const vehicle = choice('vehicle', (name) => (store.vehicle.value = name))
  const field = labelled('Vehicle', vehicle)
  store.vehicle.watch((name) => (vehicle.value = name))
  store.scene.watch((scene) => {
    const names = Object.keys(scene?.vehicles ?? {})
    setOptions(vehicle, Object.fromEntries(names.map((name) => [name, name])))
    vehicle.value = store.vehicle.value
    field.hidden = names.length < 2
  })
  return field
}
