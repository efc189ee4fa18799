// The menu: the report's table 13 from top to bottom, then scenario, time and picture.
import { sentence } from '../actions'
import type { Actions } from '../actions'
import type { Connection } from '../connection'
import type { Quality, Store } from '../store'
import { bridge } from './bridge'
import { h, setText } from './element'
import { choice, labelled, row, section, segments, setOptions, state } from './fields'
import { chosenTheme, setTheme } from './theme'
import type { Theme } from './theme'

const QUALITIES: Record<Quality, string> = {
  auto: 'Automatic',
  low: 'Low',
  high: 'High',
  ultra: 'Ultra',
  stream: 'Stream',
}
/** As fast as possible. */
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

export function menu(store: Store, connection: Connection, actions: Actions): HTMLElement {
  const panel = h(
    'aside',
    { class: 'panel menu', id: 'menu', testid: 'menu', 'aria-label': 'Menu' },
    bridge(store, connection),
    simulator(store, actions),
    time(store, actions),
    scenario(store, connection),
    picture(store),
  )
  store.isMenuOpen.watch((isOpen) => (panel.hidden = !isOpen))
  return panel
}

function simulator(store: Store, actions: Actions): HTMLElement {
  const mode = state('mode-status')
  const camera = state('camera-status')
  const light = state('scene-light-status')
  const lightButton = h('button', { testid: 'scene-light', onclick: () => actions.toggleSceneLight() }, 'Scene Light')
  const modeButton = h('button', { testid: 'mode', onclick: () => actions.toggleMode() }, 'Driving Mode')
  const vehicle = choice('vehicle', (name) => (store.vehicle.value = name))
  const vehicleField = labelled('Vehicle', vehicle)

  function show(): void {
    const frame = store.frame.value
    const isAutonomous = frame?.vehicles[store.vehicle.value]?.is_autonomous
    setText(mode, isAutonomous === undefined ? '–' : isAutonomous ? 'Autonomous' : 'Manual')
    setText(light, frame ? (frame.scene_light ? 'On' : 'Off') : '–')
    modeButton.setAttribute('aria-pressed', String(isAutonomous ?? false))
    lightButton.setAttribute('aria-pressed', String(frame?.scene_light ?? false))
  }

  store.frame.watch(show)
  store.vehicle.watch((name) => {
    vehicle.value = name
    show()
  })
  store.camera.watch((name) => setText(camera, name))
  store.scene.watch((scene) => {
    const names = Object.keys(scene?.vehicles ?? {})
    setOptions(vehicle, Object.fromEntries(names.map((name) => [name, name])))
    vehicle.value = store.vehicle.value
    vehicleField.hidden = names.length < 2
  })
  return section(
    'Simulator',
    vehicleField,
    row(h('button', { testid: 'reset', onclick: () => void actions.reset() }, 'Reset'), clock(store)),
    row(modeButton, mode),
    row(h('button', { testid: 'camera', onclick: () => actions.nextCamera() }, 'Camera'), camera),
    row(lightButton, light),
  )
}

/** Simulated time, which Reset brings to 0. */
function clock(store: Store): HTMLElement {
  const text = h('span', { class: 'state', testid: 'time' })
  store.frame.watch((frame) => {
    const seconds = Math.floor(frame?.time ?? 0)
    const parts = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, seconds % 60]
    setText(text, parts.map((part) => String(part).padStart(2, '0')).join(':'))
  })
  return text
}

function time(store: Store, actions: Actions): HTMLElement {
  const pause = h('button', { testid: 'pause', onclick: () => actions.togglePause() }, 'Pause')
  const most = 10000
  const words = { 'aria-label': 'Ticks of a step' }
  const ticks = h('input', { testid: 'ticks', type: 'number', min: 1, max: most, value: 1, ...words })
  const wanted = () => Math.min(most, Math.max(1, Math.round(Number(ticks.value)) || 1))
  const run = () => void actions.step(wanted())
  const step = h('button', { testid: 'step', title: 'Run that many ticks, then pause (N: one)', onclick: run }, 'Step')
  const speed = segments('speed', 'Speed', SPEEDS, (value) => {
    void actions.ask({ type: 'SetSpeed', factor: value === MAX ? null : Number(value) })
  })
  store.status.watch((status) => {
    if (!status) return
    setText(pause, status.is_paused ? 'Resume' : 'Pause')
    pause.setAttribute('aria-pressed', String(status.is_paused))
    speed.show(status.speed === null ? MAX : String(status.speed))
  })
  return section(
    'Time',
    h('div', { class: 'steps' }, pause, step, ticks, h('span', { class: 'muted' }, 'ticks')),
    h('div', { class: 'labelled' }, h('span', {}, 'Speed'), speed.element),
  )
}

function scenario(store: Store, connection: Connection): HTMLElement {
  const note = h('p', { class: 'note', testid: 'note', role: 'status', hidden: true })
  const fault = h('p', { class: 'fault', testid: 'scenario-fault', role: 'alert', hidden: true })
  const select = choice('scenario', (name) => void load(name), { 'aria-label': 'Scenario' })
  let isLoading = false

  async function load(name: string): Promise<void> {
    isLoading = select.disabled = true
    tell(fault, '')
    tell(note, `Loading ${store.welcome.value?.scenarios[name] ?? name}…`)
    try {
      await connection.request({ type: 'LoadScenario', name })
    } catch (words) {
      tell(fault, sentence(words))
    }
    isLoading = select.disabled = false
    show()
  }

  function show(): void {
    const scene = store.scene.value
    const known = store.welcome.value?.scenarios ?? {}
    const isKnown = !scene || scene.scenario in known
    setOptions(select, isKnown ? known : { [scene.scenario]: scene.title, ...known })
    if (isLoading) return
    if (scene) select.value = scene.scenario
    const doing = store.status.value?.note
    tell(note, doing ? sentence(doing) : '')
  }

  store.welcome.watch(show)
  store.scene.watch(show)
  store.status.watch((status) => (status?.note ? tell(note, sentence(status.note)) : show()))
  return section('Scenario', select, note, fault)
}

function tell(element: HTMLElement, words: string): void {
  setText(element, words)
  element.hidden = !words
}

function picture(store: Store): HTMLElement {
  const quality = choice('quality', (value) => (store.quality.value = value as Quality), {
    title: 'Who draws the scene: this page, or, as a stream of pictures, the simulator',
  })
  setOptions(quality, QUALITIES)
  store.quality.watch((value) => (quality.value = value))
  const scan = h('input', { type: 'checkbox', testid: 'lidar', role: 'switch' })
  scan.addEventListener('change', () => (store.isScanShown.value = scan.checked))
  store.isScanShown.watch((isShown) => (scan.checked = isShown))
  const theme = segments<Theme>('theme', 'Theme', THEMES, (value) => {
    setTheme(value)
    theme.show(value)
  })
  theme.show(chosenTheme())
  return section(
    'Picture',
    labelled('Quality', quality),
    labelled('LIDAR in the scene', scan),
    h('div', { class: 'labelled' }, h('span', {}, 'Theme'), theme.element),
  )
}
