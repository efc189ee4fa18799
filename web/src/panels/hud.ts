// The head-up display (HUD): state and sensors of the vehicle, and state of the simulation (report, table 13).
import '../hud.css'
import type { Connection } from '../connection'
import type { Store } from '../store'
import { h, setText } from './element'
import { choice } from './fields'
import { History } from './history'
import type { HudState } from './hud_rows'
import { clock, TEXTS } from './hud_rows'
import type { Rows, Section } from './hud_sections'
import { dashboard, driving, race, sensors, signalRow, simulation } from './hud_sections'
import { plot } from './plot'
import { polar } from './polar'
import { loadPreference, savePreference } from './preferences'
import type { Previews } from './previews'
import { previews } from './previews'
import { sensorView } from './sensor_view'
import type { VehicleEvents } from './vehicle_events'

/** Refresh rate of the texts [Hz]. */
const RATE = 12
/** Selectable time spans of the plots [s, simulated]. */
const WINDOWS = [10, 20, 30]

/** The HUD panel. It follows `store.isHudOpen`, and is not updated while it is hidden. */
export function hud(store: Store, connection: Connection, vehicleEvents: VehicleEvents): HTMLElement {
  const history = new History()
  const rows: Rows = new Map()
  const images = previews(store)
  const more = h('details', { class: 'hud-more', testid: 'hud-more', open: loadPreference('hud.more') === 'open' })
  const front = { element: images.front, refresh: (state: HudState) => images.refresh(state, more.open) }
  const first: Section[] = [driving(rows), race(rows), front]
  more.append(h('summary', {}, h('h2', {}, 'More: other cameras, sensors, LIDAR, plots')))
  more.addEventListener('toggle', () => savePreference('hud.more', more.open ? 'open' : 'closed'))
  const others = [
    cameras(store, connection, images, more),
    dashboard(store, rows, vehicleEvents),
    sensors(rows),
    lidar(rows, store),
    simulation(rows),
    plots(history),
  ]
  more.append(...others.map((section) => section.element))
  const old = h('p', { class: 'hud-old', testid: 'hud-old', hidden: true })
  const element = h(
    'aside',
    { id: 'hud', class: 'panel hud', testid: 'hud', 'aria-label': 'Head-up display', tabindex: -1, hidden: true },
    old,
    ...first.map((section) => section.element),
    more,
  )
  store.link.watch((link) => {
    old.hidden = link !== 'lost'
    setText(old, `Old values, of ${clock(store.frame.value?.time ?? 0)}: the connection is lost.`)
  })

  const refresh = () => {
    if (!store.isHudOpen.value || document.hidden) return
    const state = hudState(store)
    for (const [id, write] of rows) write(TEXTS[id](state))
    const shown = more.open ? [...first, ...others.filter((section) => isExpanded(section.element))] : first
    for (const section of shown) section.refresh(state)
  }

  let time = 0
  store.frame.watch((frame) => {
    if (!frame) return
    if (frame.time < time) vehicleEvents.dropAfter(frame.time)
    time = frame.time
    if (store.isHudOpen.value) history.add(hudState(store))
  })
  store.events.watch((events) => vehicleEvents.add(events))
  store.status.watch((status) => {
    const { timeline } = store.scene.value ?? {}
    if (!timeline || !status || status.position === null || !store.frame.value) return
    const lag = status.is_paused ? 0 : 0.3 * (status.speed ?? 1)
    vehicleEvents.showRecorded(timeline.marks, status.position, store.frame.value.time, 0.2 + lag)
  })
  store.vehicle.watch(() => history.clear())
  store.scene.watch(() => {
    history.clear()
    vehicleEvents.clear()
  })

  const subscribe = () => {
    const isOpen = store.isHudOpen.value
    connection.subscribe({
      scans: isOpen || store.isScanShown.value,
      picture_rate: isOpen ? 10 : 0,
      picture_width: 320,
      picture_quality: 75,
    })
  }
  let timer = 0
  store.isHudOpen.watch((isOpen) => {
    element.hidden = !isOpen
    clearInterval(timer)
    if (!isOpen) return
    history.clear()
    timer = window.setInterval(refresh, 1000 / RATE)
    refresh()
  })
  store.isHudOpen.watch(subscribe)
  store.isScanShown.watch(subscribe)
  return element
}

function hudState(store: Store): HudState {
  const frame = store.frame.value
  const name = store.vehicle.value
  return {
    frame,
    name,
    vehicle: frame?.vehicles[name] ?? null,
    scene: store.scene.value?.vehicles[name] ?? null,
    scan: store.scans.get(name) ?? null,
    bearing: store.bearing.value,
    status: store.status.value,
    warmUpLaps: store.scene.value?.warm_up_laps ?? 0,
    frameRate: store.frameRate.value,
    viewer: store.welcome.value?.name ?? '',
  }
}

/** A collapsible section; the page saves its state. */
function collapsible(id: string, title: string, ...content: HTMLElement[]): HTMLDetailsElement {
  const details = h(
    'details',
    { class: `hud-section hud-${id}`, open: loadPreference(`hud.${id}`) !== 'collapsed' },
    h('summary', {}, h('h2', {}, title)),
    ...content,
  )
  details.addEventListener('toggle', () => savePreference(`hud.${id}`, details.open ? 'open' : 'collapsed'))
  return details
}

function isExpanded(element: HTMLElement): boolean {
  return !(element instanceof HTMLDetailsElement) || element.open
}

/** Calls `refresh` every second time: drawing costs more than text. */
function everyOther<Argument>(refresh: (argument: Argument) => void): (argument: Argument) => void {
  let isDue = false
  return (argument) => {
    isDue = !isDue
    if (isDue) refresh(argument)
  }
}

function lidar(rows: Rows, store: Store): Section {
  const plan = polar((bearing) => (store.bearing.value = bearing))
  const figures = h(
    'dl',
    { class: 'lidar-figures' },
    signalRow(rows, 'lidar'),
    h('div', { class: 'bearing', title: BEARING }, h('dt', {}, 'Bearing [°]'), h('dd', {}, bearingField(store))),
    h('div', {}, h('dt', {}, 'Nearest'), plan.nearest),
    h('div', {}, h('dt', {}, 'Rings [m]'), h('dd', {}, plan.toggle)),
  )
  const element = collapsible('lidar', 'LIDAR', h('div', { class: 'lidar-split' }, plan.element, figures))
  const draw = everyOther(plan.refresh)
  return {
    element,
    refresh(state) {
      element.hidden = state.scene !== null && state.scene.lidar === null
      if (!element.hidden) draw(state)
    },
  }
}

const BEARING = 'Direction of the measurement: 0 is ahead, left is positive. A click on the plot sets it, too'

/** The bearing of the measurement in degrees, left positive. */
function bearingField(store: Store): HTMLElement {
  const limits = { min: -180, max: 180, step: 1 }
  const field = h('input', { 'aria-label': 'Bearing [°]', testid: 'hud-bearing', type: 'number', ...limits })
  field.addEventListener('input', () => {
    if (field.value) store.bearing.value = (Number(field.value) * Math.PI) / 180
  })
  store.bearing.watch((bearing) => {
    const degrees = String(Math.round((bearing * 180) / Math.PI))
    if (document.activeElement !== field) field.value = degrees
  })
  return field
}

/** The other cameras, and depth and labels; `more` contains the section. */
function cameras(store: Store, connection: Connection, images: Previews, more: HTMLDetailsElement): Section {
  const view = sensorView(store, connection)
  const element = collapsible('cameras', 'Cameras', images.others, view.element)
  const show = () => view.show(store.isHudOpen.value && more.open && element.open && !document.hidden)
  for (const details of [element, more]) details.addEventListener('toggle', show)
  document.addEventListener('visibilitychange', show)
  store.isHudOpen.watch(show)
  const hasCameras = () => (store.scene.value?.vehicles[store.vehicle.value]?.cameras.length ?? 1) > 0
  const showSection = () => (element.hidden = !hasCameras())
  store.scene.watch(showSection)
  store.vehicle.watch(showSection)
  return { element, refresh: () => {} }
}

function plots(history: History): Section {
  const both = [plot('plot-a', ['speed', 'throttle']), plot('plot-b', ['yaw-rate', 'steering'])]
  const label = { 'aria-label': 'Time span', title: 'Time span of the plots, in simulated time' }
  const window = choice('hud-plot-window', (seconds) => savePreference('plot-window', seconds), label)
  window.append(...WINDOWS.map((seconds) => h('option', { value: seconds }, `${seconds} s`)))
  const kept = loadPreference('plot-window')
  window.value = WINDOWS.includes(Number(kept)) ? String(kept) : '10'
  const element = collapsible('plots', 'Plots', window, ...both.map((one) => one.element))
  let turn = 0
  const refresh = () => {
    turn = 1 - turn
    both[turn].refresh(history, Number(window.value))
  }
  return { element, refresh }
}
