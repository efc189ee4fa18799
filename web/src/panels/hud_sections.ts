// The HUD's parts that are made of rows: what the vehicle does, what it measures, how the simulation runs.
import { h, setText } from './element'
import { clock, fixed, NONE, steering, VECTORS } from './hud_rows'
import type { Moment, Row } from './hud_rows'
import { lamps } from './lamps'
import type { Whereabouts } from './whereabouts'

export interface Section {
  element: HTMLElement
  /** Shows the moment, where a text of a row is not all. */
  refresh: (moment: Moment) => void
}

/** How each row's text is written. */
export type Rows = Map<Row, (text: string) => void>

/** A label and its value, which `rows` then writes. */
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

/** Changes a text in place, which leaves no old node behind. */
function write(place: Text, text: string): void {
  if (place.data !== text) place.data = text
}

/** What follows the number of a text, if anything. */
const UNIT = / ?(%|m\/s|rad|Hz|ms|m|×)$/

/** A bar from the middle to both sides. */
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

const STEERING = 'Right turns are positive, as in the report; messages have left turns positive'

/** Time, speed, gear, what the actuators do, lamps, notices. */
export function dashboard(rows: Rows, whereabouts: Whereabouts): Section {
  const throttle = bar()
  const wheel = bar()
  const lights = lamps()
  const road = h('dd', { class: 'badge', testid: 'hud-offroad' })
  const touched = h('span', { class: 'touched', testid: 'hud-last-collision' })
  const bumps = row(rows, 'collisions', 'Collisions')
  bumps.append(touched)
  const element = h(
    'section',
    { class: 'dashboard', 'aria-label': 'Vehicle' },
    h(
      'dl',
      { class: 'strip' },
      row(rows, 'time', 'Simulation Time', 'Since the last reset, HH:MM:SS'),
      row(rows, 'frame-rate', 'Frame Rate', 'Pictures of this page in a second'),
      row(rows, 'rtf', 'Real Time', 'Simulated seconds per second of the clock on the wall'),
    ),
    h(
      'dl',
      { class: 'motion' },
      row(rows, 'speed', 'Speed', 'Magnitude of the forward velocity of the rear axle centre'),
      row(rows, 'gear', 'Gear', 'D: drive, R: reverse, by the rear wheels'),
      row(rows, 'mode', 'Driving Mode', 'Manual: a person drives; Autonomous: a script'),
    ),
    h(
      'dl',
      { class: 'actuators' },
      withBar(row(rows, 'throttle', 'Throttle', 'Its magnitude; the bar shows reverse to the left'), throttle),
      withBar(row(rows, 'steering', 'Steering', STEERING), wheel),
    ),
    h(
      'div',
      { class: 'tell-tales' },
      lights.element,
      h('dl', {}, h('div', { class: 'fact' }, h('dt', {}, 'Road'), road)),
    ),
    h('dl', { class: 'bumps' }, bumps),
  )
  return {
    element,
    refresh(moment) {
      const { vehicle, scene, name } = moment
      throttle.set(vehicle?.throttle ?? 0)
      wheel.set(vehicle ? steering(vehicle) / (scene?.steering_limit ?? 0.5236) : 0)
      lights.refresh(vehicle)
      const isOff = whereabouts.isOffRoad(name)
      road.dataset.state = !vehicle ? 'unknown' : isOff ? 'off' : 'on'
      setText(road, !vehicle ? NONE : isOff ? 'Off road' : 'On road')
      const last = whereabouts.lastCollision(name)
      const count = vehicle?.collision_count ?? 0
      bumps.dataset.state = count > 0 ? 'some' : 'none'
      const isTold = last !== null && count > 0
      setText(touched, isTold ? `${last.other}, ${fixed(last.impulse)} N s` : '')
      touched.title = isTold ? `The last one, at ${clock(last.time)}` : ''
    },
  }
}

function withBar(element: HTMLElement, bar: { element: HTMLElement }): HTMLElement {
  element.append(bar.element)
  return element
}

/** Encoders, IPS and IMU: numbers in columns. */
export function sensors(rows: Rows): Section {
  const vectors = Object.entries(VECTORS).map(([id, vector]) => ({ ...vector, ...vectorRow(id, vector.label, vector) }))
  const heads = ['x', 'y', 'z'].map((axis) => h('span', { class: `axis axis-${axis}` }, axis))
  const element = h(
    'section',
    { class: 'sensors', 'aria-label': 'Sensors' },
    h('div', { class: 'vector heads', 'aria-hidden': 'true' }, h('span', {}), ...heads),
    h('dl', {}, ...vectors.map((vector) => vector.element)),
    h('dl', {}, row(rows, 'encoders', 'Encoder Ticks', 'Of the left and the right rear wheel')),
  )
  return {
    element,
    refresh({ vehicle }) {
      for (const { values, cells } of vectors) {
        const numbers = vehicle ? values(vehicle) : null
        cells.forEach((cell, i) => write(cell, fixed(numbers?.[i])))
      }
    },
  }
}

/** Reads as "[x, y, z] m", looks like columns. */
function vectorRow(id: string, label: string, { unit, title }: { unit: string; title: string }) {
  const cells = [0, 1, 2].map(() => new Text())
  const mark = (text: string) => h('span', { class: 'unseen' }, text)
  const value = h(
    'dd',
    { testid: `hud-${id}` },
    mark('['),
    ...cells.flatMap((text, i) => [i > 0 && mark(', '), h('span', { class: 'cell' }, text)]),
    mark('] '),
    h('span', { class: 'unit' }, unit),
  )
  return { cells, element: h('div', { class: 'vector', title }, h('dt', {}, label), value) }
}

/** Who is there, and how the connection to a script stands. */
export function simulation(rows: Rows): Section {
  const fault = h('p', { class: 'fault', testid: 'hud-bridge-fault', hidden: true })
  const bridge = row(rows, 'bridge', 'Bridge')
  const element = h(
    'section',
    { class: 'simulation', 'aria-label': 'Simulation' },
    h(
      'dl',
      {},
      bridge,
      row(rows, 'round-trip', 'Round trip', 'Telemetry sent to command received, the median'),
      row(rows, 'telemetry', 'Telemetry', 'Messages sent to the script in a second'),
      row(rows, 'commands', 'Commands', 'Messages received from the script in a second'),
      row(rows, 'driver', 'Driver', 'Who holds the wheel of this vehicle'),
      row(rows, 'viewers', 'Viewers', 'Pages and clients that watch'),
    ),
    fault,
  )
  return {
    element,
    refresh({ status }) {
      const state = status?.bridge.state ?? 'closed'
      bridge.dataset.state = state
      bridge.title = status ? `Devkit script at ${status.bridge.address}` : ''
      const text = state === 'connected' ? '' : (status?.bridge.fault ?? '')
      fault.hidden = text === ''
      setText(fault, text)
    },
  }
}
