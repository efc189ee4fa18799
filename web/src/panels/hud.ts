// The HUD: what the vehicle does and measures, and how the simulation runs (report, table 13, and more).
import '../hud.css'
import type { Connection } from '../connection'
import type { Store } from '../store'
import { h } from './element'
import { choice } from './fields'
import { History } from './history'
import { TEXTS } from './hud_rows'
import type { Moment } from './hud_rows'
import { dashboard, row, sensors, simulation } from './hud_sections'
import type { Rows, Section } from './hud_sections'
import { recall, remember } from './memory'
import { plot } from './plot'
import { polar } from './polar'
import { previews } from './previews'
import { Whereabouts } from './whereabouts'

/** Texts change so often [Hz]: faster cannot be read. */
const RATE = 12
/** Seconds of simulated time that the plots can show. */
const WINDOWS = [10, 20, 30]

/** The panel; shows and hides itself with `store.isHudOpen`, and does nothing while it is hidden. */
export function hud(store: Store, connection: Connection): HTMLElement {
  const history = new History()
  const whereabouts = new Whereabouts()
  const rows: Rows = new Map()
  const sections = [
    dashboard(rows, whereabouts),
    sensors(rows),
    lidar(rows),
    cameras(store),
    simulation(rows),
    plots(history),
  ]
  const element = h(
    'aside',
    { id: 'hud', class: 'panel hud', testid: 'hud', 'aria-label': 'Head-up display', tabindex: -1, hidden: true },
    ...sections.map((section) => section.element),
  )

  const refresh = () => {
    if (!store.isHudOpen.value || document.hidden) return
    const moment = momentOf(store)
    for (const [id, write] of rows) write(TEXTS[id](moment))
    for (const section of sections) if (isUnfolded(section.element)) section.refresh(moment)
  }

  let time = 0
  store.frame.watch((frame) => {
    if (!frame) return
    if (frame.time < time) whereabouts.forgetAfter(frame.time)
    time = frame.time
    if (store.isHudOpen.value) history.add(momentOf(store))
  })
  store.events.watch((events) => whereabouts.add(events))
  store.vehicle.watch(() => history.clear())
  store.scene.watch(() => {
    history.clear()
    whereabouts.clear()
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

function momentOf(store: Store): Moment {
  const frame = store.frame.value
  const name = store.vehicle.value
  return {
    frame,
    name,
    vehicle: frame?.vehicles[name] ?? null,
    scene: store.scene.value?.vehicles[name] ?? null,
    scan: store.scans.get(name) ?? null,
    status: store.status.value,
    frameRate: store.frameRate.value,
    viewer: store.welcome.value?.name ?? '',
  }
}

/** A section that folds away; the page remembers which are folded. */
function folding(id: string, title: string, extras: HTMLElement[], ...content: HTMLElement[]): HTMLDetailsElement {
  const details = h(
    'details',
    { class: `hud-section hud-${id}`, open: recall(`hud.${id}`) !== 'folded' },
    h('summary', {}, h('h2', {}, title), ...extras),
    ...content,
  )
  details.addEventListener('toggle', () => remember(`hud.${id}`, details.open ? 'open' : 'folded'))
  return details
}

function isUnfolded(element: HTMLElement): boolean {
  return !(element instanceof HTMLDetailsElement) || element.open
}

/** Every other time: what is drawn costs more than texts. */
function seldom<Argument>(refresh: (argument: Argument) => void): (argument: Argument) => void {
  let isDue = false
  return (argument) => {
    isDue = !isDue
    if (isDue) refresh(argument)
  }
}

function lidar(rows: Rows): Section {
  const plan = polar()
  const hint = 'What a beam that turns with the scan rate measures at the present instant; "inf" where there is nothing'
  const figures = h(
    'dl',
    { class: 'lidar-figures' },
    row(rows, 'lidar', 'LIDAR Measurement', hint),
    h('div', {}, h('dt', {}, 'Nearest'), plan.nearest),
    h('div', {}, h('dt', {}, 'Rings [m]'), h('dd', {}, plan.toggle)),
  )
  const element = folding('lidar', 'LIDAR', [], h('div', { class: 'lidar-split' }, plan.element, figures))
  return { element, refresh: seldom(plan.refresh) }
}

function cameras(store: Store): Section {
  const pictures = previews(store)
  return { element: folding('cameras', 'Cameras', [], pictures.element), refresh: pictures.refresh }
}

function plots(history: History): Section {
  const both = [plot('plot-a', ['speed', 'throttle']), plot('plot-b', ['yaw-rate', 'steering'])]
  const label = { 'aria-label': 'Time shown', title: 'Simulated time shown' }
  const window = choice('hud-plot-window', (seconds) => remember('plot-window', seconds), label)
  window.append(...WINDOWS.map((seconds) => h('option', { value: seconds }, `${seconds} s`)))
  const kept = recall('plot-window')
  window.value = WINDOWS.includes(Number(kept)) ? String(kept) : '10'
  const element = folding('plots', 'Plots', [window], ...both.map((one) => one.element))
  let turn = 0
  const refresh = () => both[(turn = 1 - turn)]!.refresh(history, Number(window.value))
  return { element, refresh }
}
