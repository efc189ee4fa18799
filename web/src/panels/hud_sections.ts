// The HUD sections that consist of rows: vehicle, sensors, simulation.
import type { HudRow } from '../channels'
import { HUD_ROWS } from '../channels'
import { lapTime } from '../lap_time'
import { touched } from '../log'
import type { Frame } from '../messages'
import { RaceStatus } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import type { HudState, Row } from './hud_rows'
import { clock, element as elementOf, fixed, NONE, reader, SENSOR_ROWS, VECTORS } from './hud_rows'
import { telltales } from './telltales'
import type { VehicleEvents } from './vehicle_events'

export interface Section {
  element: HTMLElement
  /** Updates everything except the texts of the rows. */
  refresh: (state: HudState) => void
}

/** Functions that write the text of each row. */
export type Rows = Map<Row, (text: string) => void>

/** Creates the row of a signal, with the label and the tooltip of the registry. */
export function signalRow(rows: Rows, id: Row & keyof typeof HUD_ROWS): HTMLElement {
  const { label, title }: HudRow = HUD_ROWS[id]
  return row(rows, id, label, title)
}

/** Creates a label and its value, and registers the value in `rows`. */
export function row(rows: Rows, id: Row, label: string, title = ''): HTMLElement {
  const number = new Text()
  const unit = new Text()
  rows.set(id, (text) => {
    const end = UNIT.exec(text)?.index ?? text.length
    write(number, text.slice(0, end))
    write(unit, text.slice(end))
  })
  const value = h('dd', { testid: `hud-${id}` }, number, h('span', { class: 'unit' }, unit))
  return h('div', { class: `fact fact-${id}`, title: title || null }, h('dt', {}, label), value)
}

/** Changes a text in place, without a new node. */
function write(place: Text, text: string): void {
  if (place.data !== text) place.data = text
}

/** The unit at the end of a text. */
const UNIT = / ?(%|m\/s|rad|Hz|ms|m|×)$/

/** A bar that extends from the middle to both sides. */
function bar(): { element: HTMLElement; set: (share: number) => void } {
  const filled = h('span', { class: 'bar-filled' })
  return {
    element: h('span', { class: 'bar', 'aria-hidden': 'true' }, filled),
    set(share) {
      const half = Number.isFinite(share) ? Math.max(-1, Math.min(1, share)) : 0
      filled.style.transform = `scaleX(${half.toFixed(3)})`
    },
  }
}

/** Speed, gear and driving mode. */
export function driving(rows: Rows): Section {
  const list = h('dl', { class: 'motion' }, signalRow(rows, 'speed'), signalRow(rows, 'gear'), signalRow(rows, 'mode'))
  return { element: h('section', { class: 'driving', 'aria-label': 'Driving' }, list), refresh: () => {} }
}

/** Time, actuators, lamps, road and collisions. */
export function dashboard(store: Store, rows: Rows, vehicleEvents: VehicleEvents): Section {
  const throttleBar = bar()
  const steeringBar = bar()
  const lights = telltales()
  const road = h('dd', { class: 'badge', testid: 'hud-offroad' })
  const lastCollision = h('dd', { class: 'last-collision', testid: 'hud-last-collision' })
  const collisions = signalRow(rows, 'collisions')
  collisions.append(lastCollision)
  const element = h(
    'section',
    { class: 'dashboard', 'aria-label': 'Vehicle' },
    h(
      'dl',
      { class: 'strip' },
      row(rows, 'time', 'Simulation Time', 'Simulated time since the last reset, HH:MM:SS'),
      row(rows, 'frame-rate', 'Frame Rate', 'Frames per second of the 3D view'),
      row(rows, 'rtf', 'Real Time', 'Simulated seconds per second of wall time'),
    ),
    h(
      'dl',
      { class: 'actuators' },
      withBar(signalRow(rows, 'throttle'), throttleBar),
      withBar(signalRow(rows, 'steering'), steeringBar),
    ),
    h(
      'div',
      { class: 'telltales' },
      lights.element,
      h('dl', {}, h('div', { class: 'fact' }, h('dt', {}, 'Road'), road)),
    ),
    h('dl', { class: 'collisions' }, collisions),
  )
  return {
    element,
    refresh(state) {
      const { vehicle, scene, name } = state
      throttleBar.set(vehicle?.throttle ?? 0)
      steeringBar.set(vehicle ? -vehicle.steering / (scene?.steering_limit ?? 0.5236) : 0) // to the left for left turns
      lights.refresh(vehicle)
      const isOff = vehicleEvents.isOffRoad(name)
      road.dataset.state = !vehicle ? 'unknown' : isOff ? 'off' : 'on'
      setText(road, !vehicle ? NONE : isOff ? 'Off road' : 'On road')
      const last = vehicleEvents.lastCollision(name)
      const count = vehicle?.collision_count ?? 0
      collisions.dataset.state = count > 0 ? 'some' : 'none'
      const isShown = last !== null && count > 0
      setText(lastCollision, isShown ? `${touched(last.other, store.scene.value)}, ${fixed(last.impulse)} N s` : '')
      lastCollision.title = isShown ? `Last collision, at ${clock(last.time)}` : ''
    },
  }
}

/** Laps and times of the vehicle, and the standings; hidden without a race. */
export function race(rows: Rows): Section {
  const standings = h('table', { class: 'standings', testid: 'hud-standings' })
  const lap = signalRow(rows, 'race-lap')
  const lapLabel = lap.querySelector('dt') as HTMLElement
  const element = h(
    'section',
    { class: 'race', 'aria-label': 'Race', hidden: true, testid: 'hud-race' },
    h(
      'dl',
      { class: 'strip' },
      lap,
      signalRow(rows, 'race-lap-time'),
      signalRow(rows, 'race-time'),
      signalRow(rows, 'race-penalty'),
      signalRow(rows, 'race-last-lap'),
      signalRow(rows, 'race-best-lap'),
    ),
    standings,
  )
  let written = ''
  return {
    element,
    refresh({ frame, vehicle, name, warmUpLaps }) {
      element.hidden = !vehicle?.race
      setText(lapLabel, warmUpLaps > 0 ? `Lap, ${warmUpLaps} warm-up` : 'Lap')
      const lines = frame ? standingsOf(frame) : []
      standings.hidden = lines.length < 2
      const text = JSON.stringify([name, lines])
      if (text === written) return
      written = text
      const cells = (tag: 'td' | 'th', texts: readonly string[]) => texts.map((one) => h(tag, {}, one))
      standings.replaceChildren(
        h('tr', {}, ...cells('th', ['', 'Vehicle', 'Lap', 'Gap', 'Best lap'])),
        ...lines.map((line) => h('tr', { 'aria-current': line[1] === name ? 'true' : null }, ...cells('td', line))),
      )
    },
  }
}

const OUT = { [RaceStatus.DISQUALIFIED]: 'DSQ', [RaceStatus.RETIRED]: 'DNF' } as const

/** Place, vehicle, laps, gap to the first vehicle and best lap of each vehicle in the race, in the order of places. */
function standingsOf(frame: Frame): string[][] {
  return Object.entries(frame.vehicles)
    .flatMap(([name, { race }]) => (race ? [{ name, race }] : []))
    .sort((a, b) => a.race.rank - b.race.rank)
    .map(({ name, race }) => [
      String(race.rank),
      name,
      String(race.lap_count),
      OUT[race.status as keyof typeof OUT] ?? (race.rank === 1 ? '' : `+${fixed(race.gap, 1)} s`),
      lapTime(race.best_lap_time),
    ])
}

function withBar(element: HTMLElement, bar: { element: HTMLElement }): HTMLElement {
  element.append(bar.element)
  return element
}

/** Encoders, IPS and IMU. */
export function sensors(rows: Rows): Section {
  const vectors = Object.entries(VECTORS).map(([id, vector]) => ({ ...vector, ...vectorRow(id, vector.label, vector) }))
  const others = SENSOR_ROWS.map((id) => ({ element: signalRow(rows, id), row: HUD_ROWS[id] as HudRow }))
  const optional = others.filter(({ row }) => row.optional).map((one) => ({ ...one, read: reader(one.row.signal) }))
  const heads = ['x', 'y', 'z'].map((axis) => h('span', { class: `axis axis-${axis}` }, axis))
  const element = h(
    'section',
    { class: 'sensors', 'aria-label': 'Sensors' },
    h('div', { class: 'vector heads', 'aria-hidden': 'true' }, h('span', {}), ...heads),
    h('dl', {}, ...vectors.map((vector) => vector.element)),
    h('dl', {}, ...others.map((one) => one.element)),
  )
  return {
    element,
    refresh(state) {
      for (const { values, cells } of vectors) {
        const value = values(state)
        for (const [i, cell] of cells.entries()) write(cell, fixed(elementOf(value, i)))
      }
      for (const { element, read } of optional) element.hidden = read(state) === null
    },
  }
}

/** Three numbers in columns; its text content is "[x, y, z] m". */
function vectorRow(id: string, label: string, { unit, title }: { unit: string; title: string }) {
  const cells = [0, 1, 2].map(() => new Text())
  const hidden = (text: string) => h('span', { class: 'visually-hidden' }, text)
  const value = h(
    'dd',
    { testid: `hud-${id}` },
    hidden('['),
    ...cells.flatMap((text, i) => [i > 0 && hidden(', '), h('span', { class: 'cell' }, text)]),
    hidden('] '),
    h('span', { class: 'unit' }, unit),
  )
  return { cells, element: h('div', { class: 'vector', title }, h('dt', {}, label), value) }
}

/** Bridge, driver and number of clients. */
export function simulation(rows: Rows): Section {
  const error = h('p', { class: 'error', testid: 'hud-bridge-error', hidden: true })
  const bridge = row(rows, 'bridge', 'Bridge')
  const element = h(
    'section',
    { class: 'simulation', 'aria-label': 'Simulation' },
    h(
      'dl',
      {},
      bridge,
      row(rows, 'round-trip', 'Round trip', 'Median time from sending telemetry to receiving the command'),
      row(rows, 'telemetry', 'Telemetry', 'Messages per second to the script'),
      row(rows, 'commands', 'Commands', 'Messages per second from the script'),
      row(rows, 'driver', 'Driver', 'The client that drives this vehicle'),
      row(rows, 'viewers', 'Clients', 'Number of connected pages and programs'),
    ),
    error,
  )
  return {
    element,
    refresh({ status }) {
      const state = status?.bridge.state ?? 'closed'
      bridge.dataset.state = state
      bridge.title = status ? `Devkit script at ${status.bridge.address}` : ''
      const text = state === 'connected' ? '' : (status?.bridge.error ?? '')
      error.hidden = text === ''
      setText(error, text)
    },
  }
}
