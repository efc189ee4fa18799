// What the HUD's rows say: texts of a moment, as pure functions, in the report's units (table 13).
import type { BridgeStatus, Frame, LidarScan, Status, VehicleFrame, VehicleScene } from '../messages'

/** All that a row may look at; null is what has not come yet. */
export interface Moment {
  frame: Frame | null
  /** Name of the vehicle that is watched. */
  name: string
  vehicle: VehicleFrame | null
  scene: VehicleScene | null
  scan: LidarScan | null
  status: Status | null
  /** Pictures of the page in a second [Hz]. */
  frameRate: number
  /** What others call this page. */
  viewer: string
}

/** Stands where there is no value. */
export const NONE = '–'

/** With so many decimals, never "-0.00"; what is no number is said in words. */
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
  const whole = Math.max(0, Math.floor(seconds + 1e-9)) // ticks are sums of decimal fractions
  const parts = [whole / 3600, (whole / 60) % 60, whole % 60]
  return parts.map((part) => String(Math.floor(part)).padStart(2, '0')).join(':')
}

/** R when the mean speed of the rear wheels, rounded to 0.1 rpm, is negative; else D. */
export function gear(vehicle: VehicleFrame): 'D' | 'R' {
  const spin = vehicle.wheels.angular_velocity
  const rpm = (((spin[2] ?? 0) + (spin[3] ?? 0)) / 2) * (30 / Math.PI)
  return Math.round(rpm * 10) < 0 ? 'R' : 'D'
}

/** Steering angle [rad] with the sign of the report: right turns are positive. */
export function steering(vehicle: VehicleFrame): number {
  return -vehicle.steering
}

/** Index of the ray that a beam which turns once a scan looks along at that time. */
export function presentRay(scan: LidarScan, time: number): number {
  const count = scan.ranges.length
  const turns = (time - scan.time) * scan.scan_rate
  const ray = Math.floor((turns - Math.floor(turns)) * count + 1e-6)
  return Number.isFinite(ray) && count > 0 ? ray % count : 0
}

/** What that beam measures [m]; infinite where there is nothing, or nothing that can be measured. */
export function presentRange(scan: LidarScan | null, time: number): number {
  const range = scan?.ranges[presentRay(scan, time)]
  return range !== undefined && Number.isFinite(range) ? range : Infinity
}

/** Index of the nearest return, -1 where there is none. */
export function nearestRay(scan: LidarScan): number {
  let nearest = -1
  scan.ranges.forEach((range, ray) => {
    if (Number.isFinite(range) && !(range >= (scan.ranges[nearest] ?? Infinity))) nearest = ray
  })
  return nearest
}

type Text = (moment: Moment) => string

const ofVehicle =
  (text: (vehicle: VehicleFrame) => string): Text =>
  ({ vehicle }) =>
    vehicle ? text(vehicle) : NONE
const ofStatus =
  (text: (status: Status) => string): Text =>
  ({ status }) =>
    status ? text(status) : NONE
const ofBridge = (text: (bridge: BridgeStatus) => string): Text => ofStatus((status) => text(status.bridge))

const BRIDGE = { closed: 'Disconnected', connecting: 'Connecting', connected: 'Connected' } as const

/** Each row's text, by the name of the row. */
export const TEXTS = {
  time: ({ frame }) => (frame ? clock(frame.time) : NONE),
  'frame-rate': ({ frameRate }) => `${fixed(frameRate, 0)} Hz`,
  mode: ofVehicle((vehicle) => (vehicle.is_autonomous ? 'Autonomous' : 'Manual')),
  gear: ofVehicle(gear),
  speed: ofVehicle((vehicle) => `${fixed(Math.abs(vehicle.velocity[0] ?? NaN))} m/s`),
  throttle: ofVehicle((vehicle) => `${fixed(Math.abs(vehicle.throttle) * 100)}%`),
  steering: ofVehicle((vehicle) => `${fixed(steering(vehicle))} rad`),
  encoders: ofVehicle((vehicle) => `[${[...vehicle.encoders.ticks].join(', ')}]`),
  lidar: ({ frame, scan }) => `${fixed(presentRange(scan, frame?.time ?? 0))} m`,
  rtf: ofStatus((status) => `${fixed(status.real_time_factor)} ×`),
  viewers: ofStatus((status) => String(status.viewers)),
  driver: ({ status, name, viewer }) => driver(status, name, viewer),
  bridge: ofBridge(({ state }) => BRIDGE[state]),
  telemetry: ofBridge(({ telemetry_rate }) => `${fixed(telemetry_rate, 1)} Hz`),
  commands: ofBridge(({ command_rate }) => `${fixed(command_rate, 1)} Hz`),
  'round-trip': ofBridge(({ round_trip }) => (round_trip === null ? NONE : `${fixed(round_trip * 1000, 1)} ms`)),
  collisions: ofVehicle((vehicle) => String(vehicle.collision_count)),
} satisfies Record<string, Text>

export type Row = keyof typeof TEXTS

/** A row of three numbers. */
export interface VectorRow {
  label: string
  unit: string
  title: string
  values: (vehicle: VehicleFrame) => Float64Array
}

export const VECTORS: Record<string, VectorRow> = {
  position: {
    label: 'Position',
    unit: 'm',
    title: 'IPS: x, y, z of the rear axle centre in the map',
    values: (vehicle) => vehicle.ips.position,
  },
  orientation: {
    label: 'Orientation',
    unit: 'rad',
    title: 'IMU: roll, pitch, yaw in (-π, π]; x forward, y left, z up',
    values: (vehicle) => vehicle.imu.euler,
  },
  'angular-velocity': {
    label: 'Angular velocity',
    unit: 'rad/s',
    title: 'IMU: about x, y, z of the sensor; left turns are positive',
    values: (vehicle) => vehicle.imu.angular_velocity,
  },
  'linear-acceleration': {
    label: 'Linear acceleration',
    unit: 'm/s²',
    title: 'IMU: along x, y, z of the sensor, without gravity unless the vehicle asks for it',
    values: (vehicle) => vehicle.imu.linear_acceleration,
  },
}

function driver(status: Status | null, name: string, viewer: string): string {
  const driver = status?.drivers[name]
  if (!status) return NONE
  if (!driver) return 'Nobody'
  return driver === viewer ? 'You' : driver
}
