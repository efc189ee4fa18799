// The texts of the HUD rows as pure functions of the state, in the units of the report (table 13).
import type { HudRow } from '../channels'
import { HUD_ROWS } from '../channels'
import { lapTime } from '../lap_time'
import type { BridgeStatus, Frame, LidarScan, Pose, Status, VehicleFrame, VehicleScene } from '../messages'

/** The input of all rows; null means not received yet. */
export interface HudState {
  frame: Frame | null
  /** Name of the selected vehicle. */
  name: string
  vehicle: VehicleFrame | null
  scene: VehicleScene | null
  scan: LidarScan | null
  /** Direction of the LIDAR measurement in the vehicle frame [rad], left positive. */
  bearing: number
  status: Status | null
  /** Laps of the race that do not count. */
  warmUpLaps: number
  /** Frame rate of the 3D view [Hz]. */
  frameRate: number
  /** Name of this client. */
  viewer: string
}

const TURN = 2 * Math.PI

/** Shown if there is no value. */
export const NONE = '–'

/** Formats with a fixed number of decimals, never "-0.00"; "inf" and NONE for values that are not finite. */
export function fixed(value: number | null | undefined, decimals = 2): string {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE
  if (!Number.isFinite(value)) return value > 0 ? 'inf' : '-inf'
  if (Math.abs(value) >= 1e9) return value.toExponential(2)
  const text = value.toFixed(decimals)
  return /^-[0.]+$/.test(text) ? text.slice(1) : text
}

/** Seconds as HH:MM:SS. */
export function clock(seconds: number): string {
  if (!Number.isFinite(seconds)) return NONE
  const whole = Math.max(0, Math.floor(seconds + 1e-9)) // tick times have rounding errors
  const parts = [whole / 3600, (whole / 60) % 60, whole % 60]
  return parts.map((part) => String(Math.floor(part)).padStart(2, '0')).join(':')
}

/** R if the mean speed of the rear wheels, rounded to 0.1 rpm, is negative; else D. */
export function gear(vehicle: VehicleFrame): 'D' | 'R' {
  const spin = vehicle.wheels.angular_velocity
  const rpm = (((spin[2] ?? 0) + (spin[3] ?? 0)) / 2) * (30 / Math.PI)
  return Math.round(rpm * 10) < 0 ? 'R' : 'D'
}

/** For example '0.42 m/s'. */
export function speedText(vehicle: VehicleFrame): string {
  return `${fixed(Math.abs(vehicle.velocity[0]))} m/s`
}

/** Yaw of the LIDAR in the vehicle frame [rad]. */
export function yawOf(lidar: Pose | null | undefined): number {
  const [w = 1, x = 0, y = 0, z = 0] = lidar?.orientation ?? []
  return Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
}

/** Index of the ray nearest to an angle [rad] in the axes of the sensor; -1 outside the field of view. */
export function rayAt({ ranges, angle_min, angle_increment }: LidarScan, angle: number): number {
  const step = Math.abs(angle_increment)
  const offset = (angle - angle_min) * Math.sign(angle_increment)
  const ray = Math.round((offset - TURN * Math.floor((offset + 0.5 * step) / TURN)) / step)
  return ray < ranges.length ? Math.max(0, ray) : -1
}

/** Range [m] at a bearing [rad, left positive] of the vehicle: infinite without a return, NaN without a ray. */
export function rangeAt({ scan, scene, bearing }: Pick<HudState, 'scan' | 'scene' | 'bearing'>): number {
  const range = scan?.ranges[rayAt(scan, bearing - yawOf(scene?.lidar))]
  return range === undefined ? NaN : Number.isFinite(range) ? range : Infinity
}

/** Index of the nearest return; -1 if there is none. */
export function nearestRay(scan: LidarScan): number {
  let nearest = -1
  scan.ranges.forEach((range, ray) => {
    if (Number.isFinite(range) && !(range >= (scan.ranges[nearest] ?? Infinity))) nearest = ray
  })
  return nearest
}

/** The value of a signal; null if the vehicle has none. The LIDAR scan is sent separately from the Frame. */
export type Value = number | bigint | boolean | ArrayLike<number> | ArrayLike<bigint> | null

/** Returns a function that reads the signal at that path of a VehicleFrame. */
export function reader(signal: string): (state: HudState) => Value {
  const [channel, ...fields] = signal.split('.')
  const isLidar = channel === 'lidar'
  return (state) => {
    // biome-ignore lint/suspicious/noExplicitAny: the paths come from the same source as the messages
    let value: any = isLidar ? state.scan : state.vehicle?.[channel as keyof VehicleFrame]
    for (const field of fields) value = value?.[field]
    return value ?? null
  }
}

/** The number at that index of a value, or the value itself; NaN if there is none. */
export function element(value: Value, index = 0): number {
  if (value === null) return NaN
  return Number(typeof value === 'object' ? value[index] : value)
}

type Text = (state: HudState) => string

/** A number and its unit. */
const withUnit = (text: string, unit: string) => (unit === '' ? text : `${text} ${unit}`)

/** How the text of a row is made, by its format. */
const FORMATS: Record<Exclude<HudRow['format'], 'vector'>, (value: Value, row: HudRow, state: HudState) => string> = {
  number: (value, row) => withUnit(fixed(element(value) * row.scale, row.decimals), row.unit),
  turn: (value, row) => {
    const text = fixed(element(value) * row.scale, row.decimals)
    const arrow = Number(text) > 0 ? '← ' : Number(text) < 0 ? '→ ' : ''
    return withUnit(arrow + text, row.unit)
  },
  magnitude: (value, row) => withUnit(fixed(Math.abs(element(value)) * row.scale, row.decimals), row.unit),
  list: (value) => `[${Array.from(value as ArrayLike<bigint>).join(', ')}]`,
  mode: (value) => (value ? 'Autonomous' : 'Manual'),
  gear: (_, __, { vehicle }) => (vehicle ? gear(vehicle) : NONE),
  lap: (value, _, { vehicle }) => {
    const total = vehicle?.race?.lap_total ?? 0
    return total > 0 ? `${element(value)} / ${total}` : String(element(value))
  },
  time: (value) => lapTime(element(value)),
  beam: (_, row, state) => withUnit(fixed(rangeAt(state), row.decimals), row.unit),
}

function textOf(row: HudRow): Text {
  const read = reader(row.signal)
  return (state) => {
    const value = read(state)
    if (row.format === 'vector' || value === null) return NONE
    return FORMATS[row.format](value, row, state)
  }
}

type SignalRow = keyof typeof HUD_ROWS
const SIGNAL_TEXTS = Object.fromEntries(Object.entries(HUD_ROWS).map(([id, row]) => [id, textOf(row)])) as Record<
  SignalRow,
  Text
>

const ofStatus =
  (text: (status: Status) => string): Text =>
  ({ status }) =>
    status ? text(status) : NONE
const ofBridge = (text: (bridge: BridgeStatus) => string): Text => ofStatus((status) => text(status.bridge))

const BRIDGE = { closed: 'Disconnected', connecting: 'Connecting', connected: 'Connected' } as const

/** The text of each row, by the id of the row: rows of the signals, and of the simulation. */
export const TEXTS = {
  ...SIGNAL_TEXTS,
  time: ({ frame }) => (frame ? clock(frame.time) : NONE),
  'frame-rate': ({ frameRate }) => (frameRate > 0 ? `${fixed(frameRate, 0)} Hz` : NONE), // not known yet
  rtf: ofStatus((status) => `${fixed(status.real_time_factor)} ×`),
  viewers: ofStatus((status) => String(status.clients)),
  driver: (state) => driver(state),
  bridge: ofBridge(({ state }) => BRIDGE[state]),
  telemetry: ofBridge(({ telemetry_rate }) => `${fixed(telemetry_rate, 1)} Hz`),
  commands: ofBridge(({ command_rate }) => `${fixed(command_rate, 1)} Hz`),
  'round-trip': ofBridge(({ round_trip }) => (round_trip === null ? NONE : `${fixed(round_trip * 1000, 1)} ms`)),
} satisfies Record<string, Text>

export type Row = keyof typeof TEXTS

/** A row of three numbers. */
export interface VectorRow {
  label: string
  unit: string
  title: string
  values: (state: HudState) => Value
}

export const VECTORS: Record<string, VectorRow> = Object.fromEntries(
  Object.entries(HUD_ROWS as Record<string, HudRow>)
    .filter(([, row]) => row.format === 'vector')
    .map(([id, row]) => [id, { ...row, values: reader(row.signal) }]),
)

/** Rows of single values in the section of the sensors. */
export const SENSOR_ROWS = (Object.keys(HUD_ROWS) as SignalRow[]).filter((id) => HUD_ROWS[id].section === 'sensors')

function driver({ status, vehicle, name, viewer }: HudState): string {
  if (!status) return NONE
  const { state, command_rate } = status.bridge
  if (vehicle?.is_autonomous && state === 'connected' && command_rate > 0) return 'Script'
  const driver = status.drivers[name]
  if (!driver) return 'None'
  return driver === viewer ? 'You' : driver
}
