// Generated from src/autodrive/protocol/channels.py by scripts/generate-messages: change the signals there.

/** A row of the HUD that shows a signal. */
export interface HudRow {
  label: string
  title: string
  format: 'number' | 'turn' | 'magnitude' | 'vector' | 'list' | 'mode' | 'gear' | 'beam' | 'lap' | 'time'
  unit: string
  scale: number
  decimals: number
  section: '' | 'sensors'
  /** Path in a VehicleFrame, for example 'imu.euler'. */
  signal: string
  /** Only some vehicles have this signal. */
  optional: boolean
}

/** A curve of the plots. */
export interface Plot {
  group: string
  label: string
  span: number
  element: number
  reduction: 'element' | 'nearest' | 'beam'
  unit: string
  scale: number
  /** Path in a VehicleFrame, for example 'imu.euler'. */
  signal: string
  /** Only some vehicles have this signal. */
  optional: boolean
}

export const HUD_ROWS = {
  'speed': { label: 'Speed', title: 'Magnitude of the forward velocity at the rear axle centre', format: 'magnitude', unit: 'm/s', scale: 1.0, decimals: 2, section: '', signal: 'velocity', optional: false },
  'throttle': { label: 'Throttle', title: 'Magnitude; the bar extends to the left in reverse', format: 'magnitude', unit: '%', scale: 100.0, decimals: 0, section: '', signal: 'throttle', optional: false },
  'steering': { label: 'Steering', title: 'Left is positive, as in messages; the arrow and the bar point to the side of the turn', format: 'turn', unit: 'rad', scale: 1.0, decimals: 2, section: '', signal: 'steering', optional: false },
  'encoders': { label: 'Encoder Ticks', title: 'Ticks of the left and right rear wheel', format: 'list', unit: '', scale: 1.0, decimals: 2, section: 'sensors', signal: 'encoders.ticks', optional: false },
  'position': { label: 'Position', title: 'IPS: x, y, z of the rear axle centre in the map', format: 'vector', unit: 'm', scale: 1.0, decimals: 2, section: '', signal: 'ips.position', optional: false },
  'orientation': { label: 'Orientation', title: 'IMU: roll, pitch, yaw in (-π, π]; x forward, y left, z up', format: 'vector', unit: 'rad', scale: 1.0, decimals: 2, section: '', signal: 'imu.euler', optional: false },
  'angular-velocity': { label: 'Angular velocity', title: 'IMU: about x, y, z of the sensor; left turns are positive', format: 'vector', unit: 'rad/s', scale: 1.0, decimals: 2, section: '', signal: 'imu.angular_velocity', optional: false },
  'linear-acceleration': { label: 'Linear acceleration', title: 'IMU: along x, y, z of the sensor, without gravity unless the Spec of the vehicle includes gravity', format: 'vector', unit: 'm/s²', scale: 1.0, decimals: 2, section: '', signal: 'imu.linear_acceleration', optional: false },
  'lidar': { label: 'LIDAR Measurement', title: 'Range at the bearing below; "inf" without a return, a dash outside the field of view', format: 'beam', unit: 'm', scale: 1.0, decimals: 2, section: '', signal: 'lidar.ranges', optional: false },
  'range': { label: 'Range', title: 'Nearest thing in the cone of the range sensor', format: 'number', unit: 'm', scale: 1.0, decimals: 2, section: 'sensors', signal: 'range.range', optional: true },
  'gear': { label: 'Gear', title: 'D: drive, R: reverse (from the speed of the rear wheels)', format: 'gear', unit: 'rad/s', scale: 1.0, decimals: 2, section: '', signal: 'wheels.angular_velocity', optional: false },
  'mode': { label: 'Driving Mode', title: 'Manual: a person drives. Autonomous: a script drives', format: 'mode', unit: '', scale: 1.0, decimals: 2, section: '', signal: 'is_autonomous', optional: false },
  'collisions': { label: 'Collisions', title: '', format: 'number', unit: '', scale: 1.0, decimals: 0, section: '', signal: 'collision_count', optional: false },
  'race-lap': { label: 'Lap', title: 'Completed laps, and all laps of the race, including warm-up laps', format: 'lap', unit: '', scale: 1.0, decimals: 2, section: '', signal: 'race.lap_count', optional: true },
  'race-lap-time': { label: 'Lap Time', title: 'Time in the present lap', format: 'time', unit: 's', scale: 1.0, decimals: 2, section: '', signal: 'race.lap_time', optional: true },
  'race-last-lap': { label: 'Last Lap', title: '', format: 'time', unit: 's', scale: 1.0, decimals: 2, section: '', signal: 'race.last_lap_time', optional: true },
  'race-best-lap': { label: 'Best Lap', title: 'Best time of the laps that count', format: 'time', unit: 's', scale: 1.0, decimals: 2, section: '', signal: 'race.best_lap_time', optional: true },
  'race-time': { label: 'Race Time', title: 'Time of the laps that count, without penalties', format: 'time', unit: 's', scale: 1.0, decimals: 2, section: '', signal: 'race.race_time', optional: true },
  'race-penalty': { label: 'Penalties', title: 'Time that the rules add to the race time', format: 'number', unit: 's', scale: 1.0, decimals: 0, section: '', signal: 'race.penalty', optional: true },
} as const satisfies Record<string, HudRow>

export const PLOTS = {
  'speed': { group: 'Vehicle', label: 'Speed', span: 0.1, element: 0, reduction: 'element', unit: 'm/s', scale: 1.0, signal: 'velocity', optional: false },
  'side-speed': { group: 'Vehicle', label: 'Side speed', span: 0.1, element: 1, reduction: 'element', unit: 'm/s', scale: 1.0, signal: 'velocity', optional: false },
  'throttle': { group: 'Vehicle', label: 'Throttle', span: 20.0, element: 0, reduction: 'element', unit: '%', scale: 100.0, signal: 'throttle', optional: false },
  'steering': { group: 'Vehicle', label: 'Steering', span: 0.2, element: 0, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'steering', optional: false },
  'x': { group: 'IMU and IPS', label: 'Position x', span: 0.2, element: 0, reduction: 'element', unit: 'm', scale: 1.0, signal: 'ips.position', optional: false },
  'y': { group: 'IMU and IPS', label: 'Position y', span: 0.2, element: 1, reduction: 'element', unit: 'm', scale: 1.0, signal: 'ips.position', optional: false },
  'z': { group: 'IMU and IPS', label: 'Position z', span: 0.02, element: 2, reduction: 'element', unit: 'm', scale: 1.0, signal: 'ips.position', optional: false },
  'roll': { group: 'IMU and IPS', label: 'Roll', span: 0.02, element: 0, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'imu.euler', optional: false },
  'pitch': { group: 'IMU and IPS', label: 'Pitch', span: 0.02, element: 1, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'imu.euler', optional: false },
  'yaw': { group: 'IMU and IPS', label: 'Yaw', span: 0.2, element: 2, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'imu.euler', optional: false },
  'roll-rate': { group: 'IMU and IPS', label: 'Roll rate', span: 0.2, element: 0, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'imu.angular_velocity', optional: false },
  'pitch-rate': { group: 'IMU and IPS', label: 'Pitch rate', span: 0.2, element: 1, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'imu.angular_velocity', optional: false },
  'yaw-rate': { group: 'IMU and IPS', label: 'Yaw rate', span: 0.2, element: 2, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'imu.angular_velocity', optional: false },
  'acceleration-x': { group: 'IMU and IPS', label: 'Accel. x', span: 0.5, element: 0, reduction: 'element', unit: 'm/s²', scale: 1.0, signal: 'imu.linear_acceleration', optional: false },
  'acceleration-y': { group: 'IMU and IPS', label: 'Accel. y', span: 0.5, element: 1, reduction: 'element', unit: 'm/s²', scale: 1.0, signal: 'imu.linear_acceleration', optional: false },
  'acceleration-z': { group: 'IMU and IPS', label: 'Accel. z', span: 0.5, element: 2, reduction: 'element', unit: 'm/s²', scale: 1.0, signal: 'imu.linear_acceleration', optional: false },
  'nearest': { group: 'LIDAR', label: 'Nearest', span: 0.2, element: 0, reduction: 'nearest', unit: 'm', scale: 1.0, signal: 'lidar.ranges', optional: false },
  'measurement': { group: 'LIDAR', label: 'Measurement', span: 0.2, element: 0, reduction: 'beam', unit: 'm', scale: 1.0, signal: 'lidar.ranges', optional: false },
  'range': { group: 'Range sensor', label: 'Range', span: 0.2, element: 0, reduction: 'element', unit: 'm', scale: 1.0, signal: 'range.range', optional: true },
  'slip-ratio-0': { group: 'Slip ratio', label: 'Slip ratio FL', span: 0.1, element: 0, reduction: 'element', unit: '', scale: 1.0, signal: 'wheels.slip_ratio', optional: false },
  'slip-ratio-1': { group: 'Slip ratio', label: 'Slip ratio FR', span: 0.1, element: 1, reduction: 'element', unit: '', scale: 1.0, signal: 'wheels.slip_ratio', optional: false },
  'slip-ratio-2': { group: 'Slip ratio', label: 'Slip ratio RL', span: 0.1, element: 2, reduction: 'element', unit: '', scale: 1.0, signal: 'wheels.slip_ratio', optional: false },
  'slip-ratio-3': { group: 'Slip ratio', label: 'Slip ratio RR', span: 0.1, element: 3, reduction: 'element', unit: '', scale: 1.0, signal: 'wheels.slip_ratio', optional: false },
  'slip-angle-0': { group: 'Slip angle', label: 'Slip angle FL', span: 0.02, element: 0, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'wheels.slip_angle', optional: false },
  'slip-angle-1': { group: 'Slip angle', label: 'Slip angle FR', span: 0.02, element: 1, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'wheels.slip_angle', optional: false },
  'slip-angle-2': { group: 'Slip angle', label: 'Slip angle RL', span: 0.02, element: 2, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'wheels.slip_angle', optional: false },
  'slip-angle-3': { group: 'Slip angle', label: 'Slip angle RR', span: 0.02, element: 3, reduction: 'element', unit: 'rad', scale: 1.0, signal: 'wheels.slip_angle', optional: false },
  'load-0': { group: 'Normal load', label: 'Load FL', span: 1.0, element: 0, reduction: 'element', unit: 'N', scale: 1.0, signal: 'wheels.normal_load', optional: false },
  'load-1': { group: 'Normal load', label: 'Load FR', span: 1.0, element: 1, reduction: 'element', unit: 'N', scale: 1.0, signal: 'wheels.normal_load', optional: false },
  'load-2': { group: 'Normal load', label: 'Load RL', span: 1.0, element: 2, reduction: 'element', unit: 'N', scale: 1.0, signal: 'wheels.normal_load', optional: false },
  'load-3': { group: 'Normal load', label: 'Load RR', span: 1.0, element: 3, reduction: 'element', unit: 'N', scale: 1.0, signal: 'wheels.normal_load', optional: false },
  'spin-0': { group: 'Wheel speed', label: 'Wheel FL', span: 1.0, element: 0, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'wheels.angular_velocity', optional: false },
  'spin-1': { group: 'Wheel speed', label: 'Wheel FR', span: 1.0, element: 1, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'wheels.angular_velocity', optional: false },
  'spin-2': { group: 'Wheel speed', label: 'Wheel RL', span: 1.0, element: 2, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'wheels.angular_velocity', optional: false },
  'spin-3': { group: 'Wheel speed', label: 'Wheel RR', span: 1.0, element: 3, reduction: 'element', unit: 'rad/s', scale: 1.0, signal: 'wheels.angular_velocity', optional: false },
  'compression-0': { group: 'Compression of the suspension', label: 'Spring FL', span: 0.001, element: 0, reduction: 'element', unit: 'm', scale: 1.0, signal: 'wheels.compression', optional: false },
  'compression-1': { group: 'Compression of the suspension', label: 'Spring FR', span: 0.001, element: 1, reduction: 'element', unit: 'm', scale: 1.0, signal: 'wheels.compression', optional: false },
  'compression-2': { group: 'Compression of the suspension', label: 'Spring RL', span: 0.001, element: 2, reduction: 'element', unit: 'm', scale: 1.0, signal: 'wheels.compression', optional: false },
  'compression-3': { group: 'Compression of the suspension', label: 'Spring RR', span: 0.001, element: 3, reduction: 'element', unit: 'm', scale: 1.0, signal: 'wheels.compression', optional: false },
  'collisions': { group: 'Vehicle', label: 'Collisions', span: 1.0, element: 0, reduction: 'element', unit: '', scale: 1.0, signal: 'collision_count', optional: false },
} as const satisfies Record<string, Plot>
