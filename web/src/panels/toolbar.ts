// The bar at the top: menu, speed and gear, driving mode, camera, weather, record, reset, modes of the page, help, HUD.

import type { Actions } from '../actions'
import { WEATHERS } from '../messages'
import type { Observable } from '../observable'
import type { Store } from '../store'
import { h, icon, setText } from './element'
import { choice, setOptions } from './fields'
import { gear, speedText } from './hud_rows'
import { BUILD, CAMERA, EDIT, HUD, MENU, MODE, RESET } from './icons'
import { busy, disableWhenRefused } from './pending'
import { weatherIcon, weatherName, weatherTitle } from './weather_names'

/** `record` is the button that records. */
export function toolbar(store: Store, actions: Actions, record: HTMLElement, showHelp: () => void): HTMLElement {
  const label = { 'aria-label': 'Help', title: 'Keys and controls (?)' }
  return h(
    'header',
    { class: 'toolbar' },
    opener('menu', 'Menu', MENU, 'KeyM', store.isMenuOpen),
    h('h1', { testid: 'title' }, 'AutoDRIVE Simulator'),
    speed(store),
    drivingMode(store, actions),
    camera(store, actions),
    weather(store, actions),
    record,
    reset(store, actions),
    paused(store),
    mode(store, opener('edit', 'Edit', EDIT, 'KeyJ', store.isEditing), 'Place'),
    mode(store, opener('build', 'Build', BUILD, 'KeyZ', store.isBuilding), 'UseMap'),
    opener('hud', 'HUD', HUD, 'KeyU', store.isHudOpen),
    h('button', { class: 'round', testid: 'help', onclick: showHelp, ...label }, '?'),
  )
}

/** The button of a mode, which cannot be used where its edits are refused. */
function mode(store: Store, button: HTMLButtonElement, operation: string): HTMLButtonElement {
  disableWhenRefused(store, button, operation)
  return button
}

/** A button that shows and hides a panel. */
function opener(id: string, label: string, path: string, code: string, isOpen: Observable<boolean>): HTMLButtonElement {
  const button = h(
    'button',
    {
      testid: `${id}-button`,
      'aria-controls': id,
      'aria-label': label,
      title: `${label} ({${code}})`,
      onclick: () => (isOpen.value = !isOpen.value),
    },
    icon(path),
    h('span', {}, label),
  )
  isOpen.watch((value) => button.setAttribute('aria-expanded', String(value)))
  return button
}

/** A button of the bar that acts on the simulation; a replay hides it. */
function button(id: string, label: string, path: string, title: string, onclick: () => void): HTMLButtonElement {
  const text = h('span', {}, label)
  return h('button', { class: `live bar-${id}`, testid: `bar-${id}`, title, onclick }, icon(path), text)
}

/** Speed and gear of the viewed vehicle. */
function speed(store: Store): HTMLElement {
  const value = h('span', { testid: 'bar-speed' })
  const direction = h('b', { testid: 'bar-gear', title: 'Gear: D drives forward, R in reverse' })
  const element = h('span', { class: 'bar-speed', title: 'Speed of the viewed vehicle' }, value, direction)
  store.frame.watch((frame) => {
    const vehicle = frame?.vehicles[store.vehicle.value]
    element.hidden = !vehicle
    if (!vehicle) return
    setText(value, speedText(vehicle))
    setText(direction, gear(vehicle))
  })
  return element
}

function drivingMode(store: Store, actions: Actions): HTMLElement {
  const title = 'Driving mode: in Manual you drive, in Autonomous a script (key {KeyK})'
  const element = button('mode', 'Manual', MODE, title, () => actions.toggleMode())
  const text = element.querySelector('span') as HTMLElement
  const show = () => {
    const isAutonomous = store.frame.value?.vehicles[store.vehicle.value]?.is_autonomous
    setText(text, isAutonomous ? 'Autonomous' : 'Manual')
    element.classList.toggle('is-autonomous', isAutonomous ?? false)
  }
  store.frame.watch(show)
  store.vehicle.watch(show)
  disableWhenRefused(store, element, 'SetDrivingMode')
  return element
}

function reset(store: Store, actions: Actions): HTMLElement {
  const title = 'To the start of the scenario (Shift and Backspace)'
  const element = button('reset', 'Reset', RESET, title, () => void busy(element, () => actions.reset()))
  disableWhenRefused(store, element, 'Reset')
  return element
}

function camera(store: Store, actions: Actions): HTMLElement {
  const element = button('camera', '', CAMERA, 'Next camera (key {KeyC})', () => actions.nextCamera())
  element.classList.remove('live') // a replay has cameras, too
  const text = element.querySelector('span') as HTMLElement
  store.camera.watch((name) => setText(text, name))
  return element
}

/** The weather: a list of the weathers with a name. */
function weather(store: Store, actions: Actions): HTMLElement {
  const shape = icon(weatherIcon('sunny'))
  const select = choice(
    'bar-weather',
    (name) => {
      if (name in WEATHERS) void actions.request({ type: 'SetWeather', weather: WEATHERS[name] })
    },
    { 'aria-label': 'Weather', title: 'Weather; the menu has amounts and the time of day' },
  )
  disableWhenRefused(store, select, 'SetWeather')
  const names = Object.fromEntries(Object.keys(WEATHERS).map((name) => [name, weatherTitle(name)]))
  store.frame.watch((frame) => {
    const name = weatherName(frame?.weather ?? WEATHERS.sunny)
    setOptions(select, name ? names : { '': 'Mixed', ...names })
    if (select.value !== name && document.activeElement !== select) select.value = name
    const path = weatherIcon(name)
    const drawn = shape.firstElementChild
    if (drawn?.getAttribute('d') !== path) drawn?.setAttribute('d', path)
  })
  return h('span', { class: 'live bar-weather' }, shape, select)
}

function paused(store: Store): HTMLElement {
  const element = h('b', { class: 'paused', testid: 'paused', hidden: true }, 'Paused')
  store.status.watch((status) => (element.hidden = !status?.is_paused))
  return h('div', { class: 'run', role: 'status' }, element)
}
