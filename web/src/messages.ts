// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.

export const PROTOCOL = 1

export const SUBPROTOCOL = 'autodrive.v1'

/** MessagePack extension -> what its bytes are, little-endian. */
export const ARRAYS = { 1: Float64Array, 2: BigInt64Array, 3: Float32Array, 4: Uint8Array } as const

/**
 * Bring the world to its initial state; `seed` None keeps the seed.
 */
export interface Reset {
  type: 'Reset'
  seed?: number | null
}

/**
 * Stop simulated time; readers stay connected.
 */
export interface Pause {
  type: 'Pause'
}

/**
 * Let simulated time run again.
 */
export interface Resume {
  type: 'Resume'
}

/**
 * Front lamps: off, low beam (lamp 1 of each side), high beam (lamps 1 and 2). Report, section 3.1.4.
 */
export enum Headlights { OFF = 0, LOW = 1, HIGH = 2 }

/**
 * Turning indicators: off, left, right, hazard (both). Report, section 3.1.4.
 */
export enum Indicators { OFF = 0, LEFT = 1, RIGHT = 2, HAZARD = 3 }

/**
 * What a driver wants of one vehicle.
 *
 * `throttle` [-1, 1]: fraction of the drive limit, forward positive; 0 brakes. `steering` [-1, 1]: fraction of
 * the steering limit, left positive. Both are clamped. `headlights`, `indicators`: None leaves them as they are.
 */
export interface Command {
  throttle?: number
  steering?: number
  headlights?: Headlights | null
  indicators?: Indicators | null
}

/**
 * Run `ticks` ticks while paused, the first of them with these commands, by vehicle.
 *
 * A command of a Step is obeyed whatever the driving mode: who moves time drives.
 */
export interface Step {
  type: 'Step'
  ticks?: number
  commands?: Record<string, Command>
}

/**
 * Simulated seconds per wall second; None: as fast as possible.
 */
export interface SetSpeed {
  type: 'SetSpeed'
  factor?: number | null
}

/**
 * Put a vehicle, at rest, at x, y [m] of the map with heading yaw [rad].
 */
export interface Teleport {
  type: 'Teleport'
  vehicle: string
  x: number
  y: number
  yaw?: number
}

/**
 * Day (True) or night (False).
 */
export interface SetSceneLight {
  type: 'SetSceneLight'
  enabled: boolean
}

/**
 * Who drives: a person (manual: commands of a bridge are ignored) or a script (autonomous).
 */
export interface SetDrivingMode {
  type: 'SetDrivingMode'
  vehicle: string
  is_autonomous: boolean
}

/**
 * Go over to the scenario of that name; readers stay connected.
 */
export interface LoadScenario {
  type: 'LoadScenario'
  name: string
}

/**
 * Connect the simulator to the devkit script that listens there.
 */
export interface ConnectBridge {
  type: 'ConnectBridge'
  host?: string
  port?: number
}

/**
 * End that connection, or the search for one.
 */
export interface DisconnectBridge {
  type: 'DisconnectBridge'
}

/**
 * Have a scene camera drawn by the simulator for this client, who gets `Rendered` pictures; `camera` None: no more.
 *
 * `camera`: a name of `Scene.scene_cameras`, or `Orbit`. `vehicle`: the one to follow, None: the first. `height` [m]
 * is that of the Bird's Eye; `azimuth`, `elevation` [rad] and `distance` [m] place the orbit around the vehicle.
 */
export interface SetCamera {
  type: 'SetCamera'
  camera: string | null
  vehicle?: string | null
  height?: number
  azimuth?: number
  elevation?: number
  distance?: number
  width?: number
  rate?: number
}

/**
 * A vehicle began to touch something.
 *
 * `other` is the name of the vehicle, box or fixed thing; `impulse` [N s] is the magnitude of the contact impulse
 * of the tick; `position` [m] a contact point in the map frame, shape (3,).
 */
export interface Collision {
  type: 'Collision'
  time: number
  vehicle: string
  other: string
  impulse: number
  position: Float64Array
}

/**
 * A vehicle's first wheel left the drivable area; `position` [m], shape (3,), of its rear axle centre.
 */
export interface OffRoad {
  type: 'OffRoad'
  time: number
  vehicle: string
  position: Float64Array
}

/**
 * All wheels of a vehicle are on the drivable area again.
 */
export interface BackOnRoad {
  type: 'BackOnRoad'
  time: number
  vehicle: string
  position: Float64Array
}

/**
 * The first message: the version that the client speaks, and what others shall call it.
 */
export interface Hello {
  type: 'Hello'
  protocol: number
  name?: string
}

/**
 * What this client wants to be sent from now on; before the first, Frames at 60 Hz without scans or pictures.
 *
 * `frame_rate`: Frames a second of wall time at most [Hz], None: each tick, 0: none. `scans`: whether scans come.
 * `picture_rate`: pictures of each camera a second of wall time at most [Hz], 0: none; `picture_width` [pixels], None:
 * the camera's own; `picture_quality` of the JPEG, 1 to 100. A client that is slow gets the latest, never a backlog.
 */
export interface Subscribe {
  type: 'Subscribe'
  frame_rate?: number | null
  scans?: boolean
  picture_rate?: number
  picture_width?: number | null
  picture_quality?: number
}

/**
 * A command for one vehicle. Whoever commands it holds its wheel until a `Release` or two silent seconds.
 *
 * A vehicle in manual mode obeys a person, in autonomous mode a script. A Command is good for the scenario's
 * command time-out (0.5 s of simulated time by default): send it again to keep going.
 */
export interface Drive {
  type: 'Drive'
  vehicle: string
  command: Command
  source?: 'script' | 'person'
}

/**
 * Let go of that vehicle's wheel.
 */
export interface Release {
  type: 'Release'
  vehicle: string
}

/**
 * A request; its `Done` or `Fault` carries the same `id`.
 */
export interface Please {
  type: 'Please'
  id: number
  request: Reset | Pause | Resume | Step | SetSpeed | Teleport | SetSceneLight | SetDrivingMode | LoadScenario | ConnectBridge | DisconnectBridge | SetCamera
}

/**
 * The server's first message: versions, the name that others see, and the scenarios that can be loaded.
 */
export interface Welcome {
  type: 'Welcome'
  protocol: number
  version: string
  name: string
  scenarios: Record<string, string>
}

/**
 * A lamp of a vehicle: place in the vehicle frame [m], linear RGB, how far it lights [m].
 */
export interface Lamp {
  position: [number, number, number]
  color: [number, number, number]
  range: number
}

/**
 * Position [m], shape (3,), and orientation (quaternion wxyz), shape (4,), in the map frame.
 */
export interface Pose {
  position: Float64Array
  orientation: Float64Array
}

/**
 * A vehicle as a viewer needs it. `model`: its .glb, relative to the page.
 */
export interface VehicleScene {
  type: string
  model: string
  half_length: number
  steering_limit: number
  lamps: Record<string, Lamp>
  cameras: (string)[]
  lidar: Pose | null
  wheelbase: number
  wheel_radius: number
  speed_limit: number
  sensor_noise: Record<string, number>
}

/**
 * What there is to draw; sent after the Welcome and whenever another scenario is loaded, before its first Frame.
 */
export interface Scene {
  type: 'Scene'
  scenario: string
  title: string
  map: string
  tick: number
  model: string
  vehicles: Record<string, VehicleScene>
  objects: Record<string, string>
  light_table: Record<string, any>
  scene_cameras: Record<string, Record<string, any>>
}

/**
 * How the connection to a devkit script stands; `fault` says why there is none.
 */
export interface BridgeStatus {
  address: string
  state: 'closed' | 'connecting' | 'connected'
  fault: string
  telemetry_rate: number
  command_rate: number
  round_trip: number | null
}

/**
 * What is not part of the world; sent four times a second, and at once when something in it was switched.
 */
export interface Status {
  type: 'Status'
  is_paused: boolean
  speed: number | null
  real_time_factor: number
  late_ticks: number
  viewers: number
  drivers: Record<string, string>
  bridge: BridgeStatus
  cameras_fault: string
  note: string
}

/**
 * One scan. Ray i looks along angle_min + i * angle_increment [rad] in the sensor's axes, left positive.
 *
 * `ranges` [m], shape (n_ray,): by REP 117, -inf is "too near to measure" and +inf is "nothing within range_max".
 * `intensities`, shape (n_ray,). `time` is that of the last ray; a rolling scan began `scan_time` earlier.
 * `time_increment` [s] between rays is 0 for an instantaneous scan. `scan_rate` [Hz].
 */
export interface LidarScan {
  time: number
  ranges: Float64Array
  intensities: Float64Array
  angle_min: number
  angle_increment: number
  range_min: number
  range_max: number
  scan_rate: number
  scan_time: number
  time_increment: number
}

/**
 * A new LIDAR scan; comes before the first Frame that it belongs to.
 */
export interface Scan {
  type: 'Scan'
  vehicle: string
  scan: LidarScan
}

/**
 * The pinhole of a camera, in pixels.
 *
 * A point (x, y, z) of the optical frame is seen at u = cx + fx x / z, v = cy + fy y / z, from the picture's upper
 * left corner; pixel (0, 0) covers 0 to 1 of both. `distortion` k1, k2, p1, p2, k3 moves x / z and y / z before that
 * (Brown-Conrady, as OpenCV and ROS 'plumb_bob').
 */
export interface CameraIntrinsics {
  width: number
  height: number
  fx: number
  fy: number
  cx: number
  cy: number
  distortion: [number, number, number, number, number]
}

/**
 * A new picture of a sensor camera as JPEG; comes before the first Frame that it belongs to.
 */
export interface Picture {
  type: 'Picture'
  vehicle: string
  camera: string
  time: number
  pose: Pose
  intrinsics: CameraIntrinsics
  jpeg: Uint8Array
}

/**
 * A picture of the scene camera asked for with `SetCamera`, of that simulated time [s].
 */
export interface Rendered {
  type: 'Rendered'
  time: number
  jpeg: Uint8Array
}

/**
 * Rear wheels, left then right: `ticks` (int64, shape (2,)) and `angles` [rad], shape (2,); never wrap.
 */
export interface EncoderReading {
  time: number
  ticks: BigInt64Array
  angles: Float64Array
}

/**
 * Position [m] of the rear axle centre in the map frame, shape (3,).
 */
export interface IpsReading {
  time: number
  position: Float64Array
}

/**
 * Inertial data in the axes of the sensor (REP 103, REP 145).
 *
 * `orientation` wxyz, shape (4,); `euler` roll, pitch, yaw [rad] in (-pi, pi], shape (3,), with
 * R = Rz(yaw) Ry(pitch) Rx(roll); `angular_velocity` [rad/s], shape (3,); `linear_acceleration` [m/s^2], shape
 * (3,), without gravity unless the spec asks for specific force.
 */
export interface ImuReading {
  time: number
  orientation: Float64Array
  euler: Float64Array
  angular_velocity: Float64Array
  linear_acceleration: Float64Array
}

/**
 * Rear red lamps: off, partial (with headlights), bright (brakes applied). Report, section 3.1.4.
 */
export enum TailLights { OFF = 0, PARTIAL = 1, BRIGHT = 2 }

/**
 * What the lamps do now. `left_indicator` and `right_indicator` say whether the lamp is lit at this moment.
 */
export interface Lights {
  headlights: Headlights
  indicators: Indicators
  tail_lights: TailLights
  left_indicator: boolean
  right_indicator: boolean
  reverse_lights: boolean
}

/**
 * Ground truth of the wheels, shape (4,) each: front left, front right, rear left, rear right.
 *
 * `steering_angle` [rad], `rotation_angle` [rad], `angular_velocity` [rad/s], `compression` [m] of the suspension
 * (0 at the target position), `normal_load` [N], `slip_ratio` and `slip_angle` [rad].
 */
export interface WheelsReading {
  steering_angle: Float64Array
  rotation_angle: Float64Array
  angular_velocity: Float64Array
  compression: Float64Array
  normal_load: Float64Array
  slip_ratio: Float64Array
  slip_angle: Float64Array
}

/**
 * One picture, of the moment `time` [s].
 *
 * `pose` is that of the optical frame (x right, y down, z forward, REP 103) in the map: world from camera. `rgba`
 * uint8, shape (height, width, 4), first row on top, sRGB; the fourth is 255. Where asked for: `depth` [m] float32,
 * shape (height, width), along z of the optical frame, inf where nothing is; `labels` uint8, likewise, see
 * `autodrive.render.asset.Label`.
 */
export interface CameraImage {
  time: number
  pose: Pose
  intrinsics: CameraIntrinsics
  rgba: Uint8Array
  depth: Float32Array | null
  labels: Uint8Array | null
}

/**
 * One vehicle at the time of the Frame: ground truth, actuator feedback, and the latest of every sensor.
 *
 * `pose` is that of the vehicle frame: centre of the rear axle at wheel-centre height. `velocity` [m/s] of that
 * point and `angular_velocity` [rad/s], shape (3,), are in vehicle axes. `throttle` [-1, 1] is the latest command
 * given to the drive actuators and `steering` [rad], left positive, the angle of the steering actuator (report,
 * tables 2 and 3; sampled every tick). `lidar` is None before the first scan is complete. `cameras` holds the latest
 * picture of each camera by its name ('front', 'rear'); none where cameras are off, or before the first.
 */
export interface VehicleFrame {
  pose: Pose
  velocity: Float64Array
  angular_velocity: Float64Array
  throttle: number
  steering: number
  encoders: EncoderReading
  ips: IpsReading
  imu: ImuReading
  lidar: LidarScan | null
  lights: Lights
  wheels: WheelsReading
  is_autonomous: boolean
  collision_count: number
  cameras: Record<string, CameraImage>
}

/**
 * A movable object, for example a construction box.
 */
export interface ObjectFrame {
  pose: Pose
}

/**
 * The world after a tick: `time` [s] since reset, number of ticks, vehicles and movable objects by name.
 *
 * `events` are those of this tick, in order. `scene_light` is True by day.
 */
export interface Frame {
  type: 'Frame'
  time: number
  tick: number
  vehicles: Record<string, VehicleFrame>
  objects: Record<string, ObjectFrame>
  events: (Collision | OffRoad | BackOnRoad)[]
  scene_light: boolean
}

/**
 * A request was carried out; this is the Frame after it, with all events since the last Frame sent.
 */
export interface Done {
  type: 'Done'
  id: number
  frame: Frame
}

/**
 * Something could not be done; `text` says what, and what would be right. `id`: of the request, if it was one.
 *
 * `code`: 'version' (of the Hello), 'message' (not understood), 'request' (refused), 'taken' (somebody else holds the
 * wheel), 'mode' (the driving mode lets others drive), 'rate' (too many messages).
 */
export interface Fault {
  type: 'Fault'
  code: 'version' | 'message' | 'request' | 'taken' | 'mode' | 'rate'
  text: string
  id: number | null
}

export type Ask = Reset | Pause | Resume | Step | SetSpeed | Teleport | SetSceneLight | SetDrivingMode | LoadScenario | ConnectBridge | DisconnectBridge | SetCamera

export type Event = Collision | OffRoad | BackOnRoad

export type ClientMessage = Hello | Subscribe | Drive | Release | Please

export type ServerMessage = Welcome | Scene | Status | Scan | Picture | Rendered | Done | Fault | Frame
