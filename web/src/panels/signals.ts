// Every scalar that can be plotted over time: its name, unit, and its value at a moment.
import type { VehicleFrame } from '../messages'
import { nearestRay, presentRange, steering } from './hud_rows'
import type { Moment } from './hud_rows'

export interface Scalar {
  group: string
  label: string
  unit: string
  /** What the plot's axis spans at least, so that noise does not look like news. */
  span: number
  of: (moment: Moment, vehicle: VehicleFrame) => number
}

/** By the names that the page remembers. */
export const SIGNALS = new Map<string, Scalar>()

/** Front and rear, left and right. */
const WHEELS = ['FL', 'FR', 'RL', 'RR'] as const

type Value = Scalar['of']
type Values = (vehicle: VehicleFrame) => Float64Array
function group(name: string, ...signals: [id: string, label: string, unit: string, span: number, of: Value][]): void {
  for (const [id, label, unit, span, of] of signals) SIGNALS.set(id, { group: name, label, unit, span, of })
}
function each(id: string, name: string, label: string, unit: string, span: number, of: Values): void {
  WHEELS.forEach((wheel, i) => {
    group(name, [`${id}-${i}`, `${label} ${wheel}`, unit, span, (_, vehicle) => of(vehicle)[i] ?? NaN])
  })
}
const axis =
  (of: Values, i: number): Value =>
  (_, vehicle) =>
    of(vehicle)[i] ?? NaN
const euler: Values = (vehicle) => vehicle.imu.euler
const rate: Values = (vehicle) => vehicle.imu.angular_velocity
const acceleration: Values = (vehicle) => vehicle.imu.linear_acceleration
const position: Values = (vehicle) => vehicle.ips.position

group(
  'Vehicle',
  ['speed', 'Speed', 'm/s', 0.1, (_, vehicle) => vehicle.velocity[0] ?? NaN],
  ['side-speed', 'Side speed', 'm/s', 0.1, (_, vehicle) => vehicle.velocity[1] ?? NaN],
  ['throttle', 'Throttle', '%', 20, (_, vehicle) => vehicle.throttle * 100],
  ['steering', 'Steering', 'rad', 0.2, (_, vehicle) => steering(vehicle)],
  ['collisions', 'Collisions', '', 1, (_, vehicle) => vehicle.collision_count],
)
group(
  'IMU and IPS',
  ['yaw-rate', 'Yaw rate', 'rad/s', 0.2, axis(rate, 2)],
  ['roll-rate', 'Roll rate', 'rad/s', 0.2, axis(rate, 0)],
  ['pitch-rate', 'Pitch rate', 'rad/s', 0.2, axis(rate, 1)],
  ['acceleration-x', 'Accel. x', 'm/s²', 0.5, axis(acceleration, 0)],
  ['acceleration-y', 'Accel. y', 'm/s²', 0.5, axis(acceleration, 1)],
  ['acceleration-z', 'Accel. z', 'm/s²', 0.5, axis(acceleration, 2)],
  ['roll', 'Roll', 'rad', 0.02, axis(euler, 0)],
  ['pitch', 'Pitch', 'rad', 0.02, axis(euler, 1)],
  ['yaw', 'Yaw', 'rad', 0.2, axis(euler, 2)],
  ['x', 'Position x', 'm', 0.2, axis(position, 0)],
  ['y', 'Position y', 'm', 0.2, axis(position, 1)],
  ['z', 'Position z', 'm', 0.02, axis(position, 2)],
)
group(
  'LIDAR',
  ['nearest', 'Nearest', 'm', 0.2, ({ scan }) => (scan && scan.ranges[nearestRay(scan)]) ?? NaN],
  ['measurement', 'Measurement', 'm', 0.2, ({ scan, frame }) => presentRange(scan, frame?.time ?? 0)],
)
each('slip-ratio', 'Slip ratio', 'Slip ratio', '', 0.1, (vehicle) => vehicle.wheels.slip_ratio)
each('slip-angle', 'Slip angle', 'Slip angle', 'rad', 0.02, (vehicle) => vehicle.wheels.slip_angle)
each('load', 'Normal load', 'Load', 'N', 1, (vehicle) => vehicle.wheels.normal_load)
each('spin', 'Wheel speed', 'Wheel', 'rad/s', 1, (vehicle) => vehicle.wheels.angular_velocity)
each('compression', 'Compression of the suspension', 'Spring', 'm', 0.001, (vehicle) => vehicle.wheels.compression)
group(
  'Simulation and bridge',
  ['rtf', 'Real time', '×', 0.1, ({ status }) => status?.real_time_factor ?? NaN],
  ['frame-rate', 'Frame rate', 'Hz', 10, ({ frameRate }) => frameRate],
  ['telemetry', 'Telemetry', 'Hz', 10, ({ status }) => status?.bridge.telemetry_rate ?? NaN],
  ['commands', 'Commands', 'Hz', 10, ({ status }) => status?.bridge.command_rate ?? NaN],
  ['round-trip', 'Round trip', 'ms', 1, ({ status }) => (status?.bridge.round_trip ?? NaN) * 1000],
)
