// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.

export const PROTOCOL = 2

export const SUBPROTOCOL = 'autodrive.v2'

/** MessagePack extension -> what its bytes are, little-endian. */
export const ARRAYS = { 1: Float64Array, 2: BigInt64Array, 3: Float32Array, 4: Uint8Array, 5: Uint16Array } as const

/**
 * Restore the initial state of the world; `seed` None keeps the seed.
 */
export interface Reset {
  type: 'Reset'
  seed?: number | null
}

/**
 * Stop simulated time; clients stay connected.
 */
export interface Pause {
  type: 'Pause'
}

/**
 * Continue simulated time.
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
 * Command of a driver for one vehicle.
 *
 * `throttle` [-1, 1]: fraction of the drive limit, forward positive; 0 brakes. `steering` [-1, 1]: fraction of
 * the steering limit, left positive. Both are clamped. `headlights`, `indicators`: None keeps their state.
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
 * The commands of a Step apply in every driving mode. In a replay: show a Frame `ticks` later, or earlier if negative.
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
 * Show that time of the recording [s]; a simulation refuses it.
 */
export interface Seek {
  type: 'Seek'
  time: number
}

/**
 * Place a vehicle, at rest, at x, y [m] in the map frame with heading yaw [rad], until a Reset.
 *
 * `vehicle` may also be the name of a movable object.
 */
export interface Teleport {
  type: 'Teleport'
  vehicle: string
  x: number
  y: number
  yaw?: number
}

/**
 * Hold a vehicle at a pose in the map frame, against all forces, from the next tick on: another program moves it.
 *
 * `position` [m] of the rear axle centre; None ends the hold. `orientation`: quaternion wxyz of any length.
 */
export interface Hold {
  type: 'Hold'
  vehicle: string
  position: [number, number, number] | null
  orientation?: [number, number, number, number]
}

/**
 * Day (True) or night (False); ends a time of day.
 */
export interface SetSceneLight {
  type: 'SetSceneLight'
  enabled: boolean
}

/**
 * Let sun and sky follow a time of day.
 *
 * `time`: since midnight [s]; None keeps it (noon if none is set). `scale`: seconds of the day per simulated second.
 */
export interface SetTimeOfDay {
  type: 'SetTimeOfDay'
  time: number | null
  scale?: number
}

/**
 * Weather, and the state of the ground; the default is a clear sky over dry ground.
 *
 * `wetness` and `snow_cover` of the ground: None lets them follow rain and snow, a number holds them. A Frame has
 * their values. See `docs/weather.md` for the amounts in units of physics.
 */
export interface Weather {
  clouds: number
  fog: number
  rain: number
  snow: number
  wind: number
  wetness: number | null
  snow_cover: number | null
}

/**
 * Set the weather, all of it: what `weather` leaves out is none. The ground follows with its time constants.
 *
 * `keeps_ground`: what `weather` does not say of wetness and snow cover stays as it is: held, or following.
 */
export interface SetWeather {
  type: 'SetWeather'
  weather?: Weather
  keeps_ground?: boolean
}

/**
 * Points, lines or a text in the view, not in the images of sensors. See `DrawCalls`.
 *
 * `points` x, y, z [m] in the map frame. 'path': a line through all; 'lines': one between each pair; 'text': its
 * middle. `color`: red, green, blue and opacity, 0 to 1, sRGB. `size` [m]: diameter of points, width of lines, height
 * of a text. `lifetime`: simulated time after which it disappears [s]; None: it stays.
 */
export interface Drawing {
  kind: 'points' | 'path' | 'lines' | 'text'
  points: ([number, number, number])[]
  text: string
  color: [number, number, number, number]
  size: number
  lifetime: number | null
}

/**
 * Draw, replace or remove (None) drawings, by name; `clears`: remove all others. A reset removes all.
 */
export interface Draw {
  type: 'Draw'
  drawings: Record<string, Drawing | null>
  clears?: boolean
}

/**
 * What a traffic light shows; the numbers are those of the devkit.
 */
export enum TrafficLightState { OFF = 0, RED = 1, YELLOW = 2, GREEN = 3 }

/**
 * Let a traffic light show that state until a Reset; None: what its program says, or nothing without a program.
 */
export interface SetTrafficLight {
  type: 'SetTrafficLight'
  light: string
  state: TrafficLightState | null
}

/**
 * Set the source of commands of a vehicle: a person (manual; scripts are ignored) or a script (autonomous).
 */
export interface SetDrivingMode {
  type: 'SetDrivingMode'
  vehicle: string
  is_autonomous: boolean
}

/**
 * End the race of a vehicle, which retires or is disqualified; the reason is in its `RaceStatusChanged`.
 */
export interface Retire {
  type: 'Retire'
  vehicle: string
  reason?: string
  is_disqualified?: boolean
}

/**
 * Load the scenario of that name; clients stay connected.
 */
export interface LoadScenario {
  type: 'LoadScenario'
  name: string
}

/**
 * Place a vehicle or a movable object, at rest, at x, y [m] on the ground with heading yaw [rad].
 *
 * As `Teleport`, but an edit: the scenario starts with it there, also after a `Reset`.
 */
export interface Place {
  type: 'Place'
  name: string
  x: number
  y: number
  yaw?: number
}

/**
 * Add a movable box on the ground at x, y [m] with heading yaw [rad]; length, width, height [m]; mass [kg].
 */
export interface AddBox {
  type: 'AddBox'
  name: string
  x: number
  y: number
  yaw?: number
  size?: [number, number, number]
  mass?: number
}

/**
 * Remove a movable box, of the scenario or of its map.
 */
export interface RemoveBox {
  type: 'RemoveBox'
  name: string
}

/**
 * Switch a sensor or camera of a vehicle on or off, and set its sample rate [Hz] and noise.
 *
 * `sensor`: 'encoders', 'ips', 'imu', 'lidar', 'range', or the name of a camera. Off: no scans, ranges or images;
 * encoders, IPS and IMU keep their reading. `rate` None: as in the vehicle's file. `noise`: 'ideal' (none), 'file' (as
 * in the vehicle's file), 'realistic' (of the data sheet, if it has noise) or 'strong'; None: as in the scenario.
 */
export interface SetSensor {
  type: 'SetSensor'
  vehicle: string
  sensor: string
  is_on?: boolean
  rate?: number | null
  noise?: 'ideal' | 'file' | 'realistic' | 'strong' | null
}

/**
 * Remove the traffic of the scenario: on some maps, and on race tracks, traffic cannot drive. Time starts anew.
 */
export interface RemoveTraffic {
  type: 'RemoveTraffic'
}

/**
 * A placed module: x, y [m] and heading yaw [rad] of the middle of its footprint.
 *
 * `module`: a name of `MapScene.modules`. `open`: ports that may stay unconnected; True: all. Terrain and boxes only:
 * `length` and `width` [m]; None: as in the module's file. Boxes only: `height` [m], `mass` [kg], and `z` [m], the
 * height of the underside above the ground.
 */
export interface MapModule {
  type: 'MapModule'
  module: string
  x: number
  y: number
  yaw: number
  open: boolean | (string)[]
  length: number | null
  width: number | null
  height: number | null
  z: number
  mass: number | null
}

/**
 * A wall along a line through points x, y [m], from the last to the first if `is_closed`; thickness, height [m].
 */
export interface MapWall {
  type: 'MapWall'
  points: ([number, number])[]
  height: number
  thickness: number
  is_closed: boolean
}

/**
 * A static box on the ground, such as a building: middle x, y [m], heading yaw [rad], sizes [m].
 */
export interface MapBlock {
  type: 'MapBlock'
  x: number
  y: number
  length: number
  width: number
  height: number
  yaw: number
}

/**
 * A traffic sign or traffic light at x, y [m] whose face looks along yaw [rad]; `kind`: one of `MapScene.props`.
 */
export interface MapProp {
  type: 'MapProp'
  kind: string
  x: number
  y: number
  yaw: number
}

/**
 * Add, replace or remove (None) parts of the map, by name. It is one edit, however many parts it has.
 *
 * `seen`: the parts as the client knows them; None: not there. If a part is different now, because another client has
 * changed it, the edit is refused.
 */
export interface EditMap {
  type: 'EditMap'
  parts: Record<string, MapModule | MapWall | MapBlock | MapProp | null>
  seen?: Record<string, MapModule | MapWall | MapBlock | MapProp | null>
}

/**
 * Replace the map by a map of the simulator, one of `MapScene.templates`, or by the `text` of a file (YAML).
 *
 * The text is that of a map or of a track.
 *
 * The modules of a text are those of `MapScene.modules`, and of `modules`: names in the text -> texts of their files.
 * Its map is a draft, which may be unfinished.
 */
export interface UseMap {
  type: 'UseMap'
  name?: string
  text?: string
  modules?: Record<string, string>
}

/**
 * Close a road: add roads from an open end of the module `part` to an open end of the module `other`, as one edit.
 *
 * Without `port` or `other_port`, any open end of the module; without `other`, the nearest open end that can be
 * reached. Without `part`, all open ends of the map: roads lead from one to another where they fit, and the ends that
 * are left get the end of a road.
 */
export interface CloseLoop {
  type: 'CloseLoop'
  part?: string
  port?: string
  other?: string
  other_port?: string
}

/**
 * Insert a module where the port `port` of the module `part` is joined with another one, as one edit.
 *
 * The road behind the joint is moved. A closed road is closed again by other roads, in another place or instead of
 * some roads behind the joint. `entry`: the port of the new module at `port`; left out: one that fits.
 */
export interface InsertModule {
  type: 'InsertModule'
  module: string
  part: string
  port: string
  entry?: string
}

/**
 * A track by points x, y [m] of a smooth closed line, in driving direction; `width` between the barriers [m].
 *
 * The start line goes through the first point. `barrier`: what stands along the edges; a duct is an air duct.
 */
export interface TrackLine {
  points: ([number, number])[]
  width: number
  barrier: 'wall' | 'duct'
}

/**
 * Replace the map by a track by points, or change its track. Vehicles beside the new track go to its start.
 *
 * `seen`: the track as the client knows it. If it is different now, because another client has changed it, the edit
 * is refused; None: the edit is made in any case.
 */
export interface EditTrack {
  type: 'EditTrack'
  track: TrackLine
  seen?: TrackLine | null
}

/**
 * Replace the map by a random track by points: the same for the same `seed`; about that length, and width [m].
 */
export interface GenerateTrack {
  type: 'GenerateTrack'
  seed?: number
  length?: number
  width?: number
  barrier?: 'wall' | 'duct'
}

/**
 * Revert the latest edit.
 */
export interface Undo {
  type: 'Undo'
}

/**
 * Make the edit again that was reverted last.
 */
export interface Redo {
  type: 'Redo'
}

/**
 * Request the scenario with all edits, as YAML, in the `text` of the Response, with that title if there is one.
 */
export interface SaveScenario {
  type: 'SaveScenario'
  title?: string
}

/**
 * Request the map with all edits, as YAML, in the `text` of the Response, with that title if there is one.
 */
export interface SaveMap {
  type: 'SaveMap'
  title?: string
}

/**
 * Connect the simulator to the devkit script that listens at that address.
 */
export interface ConnectBridge {
  type: 'ConnectBridge'
  host?: string
  port?: number
}

/**
 * Close that connection, or stop trying to connect.
 */
export interface DisconnectBridge {
  type: 'DisconnectBridge'
}

/**
 * Let the simulator render a scene camera for this client and send `Rendered` images; `camera` None: stop.
 *
 * `camera`: a name of `Scene.scene_cameras`, `Orbit` or `Fly`. `vehicle` to follow, None: the first vehicle. `height`
 * [m] of the Bird's Eye; `azimuth`, `elevation` [rad] and `distance` [m] place the orbit around the vehicle. Fly is at
 * `position` [m] in the map, and looks along `azimuth` (0: the x axis, left positive) and `elevation` (up positive).
 * `zoom` multiplies the focal length. `drawings` of programs, collision `shapes`, and `axes` of vehicles and sensors
 * are drawn into the image, and contact forces if `force_scale` is more than 0: the force of an arrow of 10 cm [N].
 */
export interface SetCamera {
  type: 'SetCamera'
  camera: string | null
  vehicle?: string | null
  height?: number
  azimuth?: number
  elevation?: number
  distance?: number
  zoom?: number
  width?: number
  rate?: number
  position?: [number, number, number]
  drawings?: boolean
  shapes?: boolean
  axes?: boolean
  force_scale?: number
}

/**
 * Let the simulator render the depth or the labels of what a sensor camera sees, and send `SensorView`s.
 *
 * `camera` None: stop. `vehicle` None: the first one. `farthest`: depth at which the colours end [m]. `width` in
 * pixels, at most that of the camera; `rate` [Hz] in wall time. The distortion of the lens is left out. The camera
 * itself, and its images, do not change.
 */
export interface ViewSensor {
  type: 'ViewSensor'
  camera: string | null
  vehicle?: string | null
  content?: 'depth' | 'labels'
  farthest?: number
  width?: number
  rate?: number
}

/**
 * Let the driver that is included in the simulator drive a vehicle, or give the vehicle back to the person.
 *
 * The vehicle is in autonomous mode meanwhile. The driver ends with `SetDrivingMode`, a `Reset` or another scenario.
 */
export interface LetDrive {
  type: 'LetDrive'
  vehicle: string
  is_on?: boolean
}

/**
 * What the present weather means in numbers: the `text` of the Response, as `autodrive weather` prints it.
 */
export interface DescribeWeather {
  type: 'DescribeWeather'
}

/**
 * The URDF of a vehicle as it is now, with the poses of its sensors: the `text` of the Response.
 *
 * Its meshes are files of the ROS package autodrive_description, which has those of the shipped vehicles.
 */
export interface DescribeVehicle {
  type: 'DescribeVehicle'
  vehicle: string
}

/**
 * Record the simulation into a file of the simulator.
 *
 * `keep` None: everything from now on, until a `StopRecording`. A number: only the last `keep` seconds are kept, until
 * a `SaveRecording` writes them.
 */
export interface StartRecording {
  type: 'StartRecording'
  keep?: number | null
}

/**
 * End the recording. What was kept with `keep` and not saved is dropped.
 */
export interface StopRecording {
  type: 'StopRecording'
}

/**
 * Write the last seconds that a `StartRecording` with `keep` has kept; the recording continues.
 */
export interface SaveRecording {
  type: 'SaveRecording'
}

/**
 * Film the latest recording of this simulator, beside the simulation: `RecordingStatus.film` says how far it is.
 *
 * `camera`: a scene camera, or a camera of a vehicle such as 'front'. `vehicle`: the one that it follows, or on which
 * it is; None: the first one. The film is then at the address recordings/NAME, relative to the page.
 */
export interface FilmRecording {
  type: 'FilmRecording'
  camera?: string
  vehicle?: string | null
}

/**
 * Serve a recording with its page; the text of the Response is the port.
 *
 * `name`: a file of the simulator's folder of recordings, such as 'drive.mcap'; empty: the latest recording.
 */
export interface ReplayRecording {
  type: 'ReplayRecording'
  name?: string
}

/**
 * Request curves of the recording that is shown; they are in the `curves` of the Response.
 *
 * `plots`: ids of `PLOTS` in channels.ts. `start`, `end`: times of the recording [s]; `end` None: its end. `columns`:
 * the time is divided into this many equal parts, with the least and the greatest value of each.
 */
export interface PlotRecording {
  type: 'PlotRecording'
  vehicle: string
  plots: (string)[]
  start?: number
  end?: number | null
  columns?: number
}

/**
 * Replace the map by the track in a picture of a map, as `autodrive import track`; it is the edit of a `UseMap`.
 *
 * `picture`: a PNG or PGM file, or that file compressed with zlib. `text`: its YAML file of ROS map_server, with
 * `resolution`, `origin` and `negate`. `start`: a place on the track where the start line is, in pixels from the upper
 * left corner to the right and down; None: the straightest place of the largest free ring. `gap`: openings of the
 * walls that are narrower are closed [m]. `is_reversed`: driven clockwise. The `text` of the Response has warnings
 * about probable mistakes.
 */
export interface ImportTrack {
  type: 'ImportTrack'
  picture: Uint8Array
  text: string
  name?: string
  start?: [number, number] | null
  gap?: number
  is_reversed?: boolean
}

/**
 * Open a scenario, map or track: a file of the user's folder by its name, or the `text` of any file, called `name`.
 *
 * A map or track is the edit of a `UseMap`; a scenario is loaded as by a `LoadScenario`. A text names only vehicles,
 * maps, modules, tracks and rules of the simulator and of the present scenario: no other file is read.
 */
export interface OpenFile {
  type: 'OpenFile'
  name: string
  text?: string
}

/**
 * Request the files of the user's folder, in the `files` of the Response.
 */
export interface ListFiles {
  type: 'ListFiles'
}

/**
 * Write the map or scenario with all edits into the user's folder, as NAME.yaml, with that title if there is one.
 *
 * A file of that name is replaced only if `replaces`. The `text` of the Response is the name of the file.
 */
export interface SaveFile {
  type: 'SaveFile'
  name: string
  kind?: 'map' | 'scenario'
  title?: string
  replaces?: boolean
}

/**
 * Request the map for map_server of ROS: the `picture` (PNG) and `text` (YAML, for NAME.png) of the Response.
 *
 * `resolution`: edge of a pixel [m]. Gaps between the ducts of a track are closed.
 */
export interface ExportMap {
  type: 'ExportMap'
  name?: string
  resolution?: number
}

/**
 * First contact of a vehicle with another object, which it has not touched for 0.2 s.
 *
 * A wall of the map file, with all its parts, is one object. `other` is the name of the vehicle, box or part of the
 * map; `impulse` [N s] is the magnitude of the contact impulse of the tick, `CollisionEnded` has that of the whole
 * collision; `position` [m] is a contact point in the map frame, shape (3,).
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
 * A vehicle has not touched an object of a `Collision` for 0.2 s.
 *
 * `other` is that of the `Collision`; `impulse` [N s] is the sum of the magnitudes of the contact impulses of all
 * ticks, `duration` [s] the time from the first to the last of these ticks.
 */
export interface CollisionEnded {
  type: 'CollisionEnded'
  time: number
  vehicle: string
  other: string
  impulse: number
  duration: number
}

/**
 * The first wheel of a vehicle left the drivable area; `position` [m], shape (3,), is its rear axle centre.
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
 * The front of a vehicle crossed the stop line of a traffic light at red.
 *
 * `position` [m], shape (3,), is the rear axle centre of the vehicle.
 */
export interface RedLight {
  type: 'RedLight'
  time: number
  vehicle: string
  light: string
  position: Float64Array
}

/**
 * The front of a vehicle crossed the stop line of a stop sign, and the vehicle had not stopped before the line.
 *
 * `position` [m], shape (3,), is the rear axle centre of the vehicle.
 */
export interface StopSign {
  type: 'StopSign'
  time: number
  vehicle: string
  sign: string
  position: Float64Array
}

/**
 * A vehicle passed a checkpoint at `time`, within the tick; `lap` from 1, `split` [s] since the start of the lap.
 *
 * `sector_time` [s] since the checkpoint that it passed before. The finish line is the last checkpoint.
 */
export interface CheckpointPassed {
  type: 'CheckpointPassed'
  time: number
  vehicle: string
  lap: number
  checkpoint: number
  split: number
  sector_time: number
  position: Float64Array
}

/**
 * A vehicle completed a lap at `time`, within the tick; `lap` from 1. `is_counted`: not a warm-up lap.
 */
export interface LapCompleted {
  type: 'LapCompleted'
  time: number
  vehicle: string
  lap: number
  lap_time: number
  is_counted: boolean
  position: Float64Array
}

/**
 * The rules add `duration` [s] to the time of a vehicle.
 */
export interface RacePenalty {
  type: 'RacePenalty'
  time: number
  vehicle: string
  reason: string
  duration: number
  position: Float64Array
}

/**
 * The rules set a vehicle back to a checkpoint, 0: the start line; `position` is that before.
 */
export interface SetBack {
  type: 'SetBack'
  time: number
  vehicle: string
  checkpoint: number
  position: Float64Array
}

/**
 * A vehicle drives against the direction of the track.
 */
export interface WrongWay {
  type: 'WrongWay'
  time: number
  vehicle: string
  position: Float64Array
}

/**
 * A vehicle in a race: it waits for the start, races, has finished, is disqualified, or has retired.
 */
export enum RaceStatus { WAITING = 0, RACING = 1, FINISHED = 2, DISQUALIFIED = 3, RETIRED = 4 }

/**
 * A vehicle started, finished, retired or was disqualified, for this reason.
 */
export interface RaceStatusChanged {
  type: 'RaceStatusChanged'
  time: number
  vehicle: string
  status: RaceStatus
  reason: string
  position: Float64Array
}

/**
 * The first message: the version that the client speaks, and its display name.
 */
export interface Hello {
  type: 'Hello'
  protocol: number
  name?: string
}

/**
 * Selects what the client is sent. Before the first Subscribe: Frames at 60 Hz, no scans, no pictures.
 *
 * `frame_rate`: largest rate of Frames in wall time [Hz], None: each tick, 0: none. `scans`, `drawings`: whether they
 * are sent, as for `shapes` (`Shapes`) and `contacts` (`Contacts`), which cost time only while a client wants them.
 * `picture_rate`: largest rate of pictures of each camera in wall time [Hz], 0: none; `picture_width` [pixels], None:
 * the width of the camera; `picture_quality` of the JPEG, 1 to 100. A slow client gets the latest Frame, never a
 * backlog. `frames_of_readings`: whether the Frame of a scan or picture follows it at once, also beyond `frame_rate`.
 * `ways`: whether `Ways` are sent.
 */
export interface Subscribe {
  type: 'Subscribe'
  frame_rate?: number | null
  scans?: boolean
  picture_rate?: number
  picture_width?: number | null
  picture_quality?: number
  drawings?: boolean
  shapes?: boolean
  contacts?: boolean
  frames_of_readings?: boolean
  ways?: boolean
}

/**
 * A command for one vehicle. The client becomes its driver until a `Release` or 2 s without a command.
 *
 * A vehicle in manual mode obeys a person, in autonomous mode a script. A Command is valid for the scenario's
 * command time-out (0.5 s of simulated time by default): send it again to keep driving.
 */
export interface Drive {
  type: 'Drive'
  vehicle: string
  command: Command
  source?: 'script' | 'person'
}

/**
 * Stop being the driver of that vehicle.
 */
export interface Release {
  type: 'Release'
  vehicle: string
}

/**
 * Requests an operation; the `Response` or `Error` has the same `id`.
 */
export interface Request {
  type: 'Request'
  id: number
  operation: Reset | Pause | Resume | Step | SetSpeed | Seek | Teleport | Hold | SetSceneLight | SetTimeOfDay | SetWeather | Draw | SetTrafficLight | SetDrivingMode | Retire | LoadScenario | Place | AddBox | RemoveBox | SetSensor | RemoveTraffic | EditMap | UseMap | CloseLoop | InsertModule | EditTrack | GenerateTrack | Undo | Redo | SaveScenario | SaveMap | ConnectBridge | DisconnectBridge | SetCamera | ViewSensor | LetDrive | DescribeWeather | DescribeVehicle | StartRecording | StopRecording | SaveRecording | FilmRecording | ReplayRecording | PlotRecording | ImportTrack | OpenFile | ListFiles | SaveFile | ExportMap
  heard?: number | null
}

/**
 * A lamp of a vehicle: position in the vehicle frame [m], linear RGB, range of its light [m].
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
 * Settings of a sensor or camera, as `SetSensor` changes them.
 */
export interface SensorScene {
  is_on: boolean
  rate: number | null
  noise: string
  noises: (string)[]
  is_camera: boolean
}

/**
 * What a client needs to draw a vehicle. `model`: address of its .glb, relative to the page.
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
  size: [number, number, number]
  is_traffic: boolean
  sensors: Record<string, SensorScene>
  missing_gravity: number
  is_lidar_level: boolean
}

/**
 * A drawing of the map from above, with walls and lanes; x to the right, y up.
 *
 * `image`: address of the SVG file, relative to the page. `bounds` [m]: least x and y, greatest x and y.
 */
export interface Plan {
  image: string
  bounds: [number, number, number, number]
}

/**
 * An event at a time of the recording [s]; the time of the event itself starts again at a Reset.
 */
export interface Mark {
  time: number
  event: Collision | CollisionEnded | OffRoad | BackOnRoad | RedLight | StopSign | CheckpointPassed | LapCompleted | RacePenalty | SetBack | WrongWay | RaceStatusChanged
}

/**
 * The recording that is shown: name of its file, duration [s], and its events in order.
 */
export interface Timeline {
  name: string
  duration: number
  marks: (Mark)[]
}

/**
 * A port of a module: a pose x, y [m], yaw [rad] that faces outward, and the width of its road [m].
 *
 * `state` in a map: 'joined' to another port; 'open': it may stay unconnected; 'free': it is not connected yet;
 * 'wrong': a port near it does not fit. In a module: 'free'.
 */
export interface MapPort {
  x: number
  y: number
  yaw: number
  width: number
  state: 'joined' | 'open' | 'free' | 'wrong'
}

/**
 * What is wrong with the map, where [m], and which parts it concerns.
 *
 * `repair`: parts with which an `EditMap` repairs it; empty if that is not known.
 */
export interface MapProblem {
  kind: string
  text: string
  x: number
  y: number
  parts: (string)[]
  repair: Record<string, MapModule | MapWall | MapBlock | MapProp>
  vehicle: string
  place: [number, number, number] | null
}

/**
 * A module that a map can have. `image`: address of its drawing from above (SVG), relative to the page.
 */
export interface ModuleScene {
  title: string
  type: string
  length: number
  width: number
  image: string
  ports: Record<string, MapPort>
}

/**
 * The map as `EditMap` changes it.
 */
export interface MapScene {
  parts: Record<string, MapModule | MapWall | MapBlock | MapProp>
  ports: Record<string, Record<string, MapPort>>
  problems: (MapProblem)[]
  modules: Record<string, ModuleScene>
  props: (string)[]
  templates: Record<string, string>
  advice: (MapProblem)[]
  faces: Record<string, string>
}

/**
 * The race track as `EditTrack` changes it.
 */
export interface TrackScene {
  line: TrackLine
  is_exact: boolean
  problems: (MapProblem)[]
  templates: Record<string, string>
}

/**
 * What a client needs to draw the world; sent after the Welcome, and before the Frames of another World.
 *
 * Another scenario has another World, and so has an edit that does not only move things.
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
  label_colours: Record<string, string>
  object_sizes: Record<string, [number, number, number]>
  plan: Plan | null
  warm_up_laps: number
  timeline: Timeline | null
  map_scene: MapScene | null
  ground: (string)[]
  track_scene: TrackScene | null
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
 * One scan. Ray i has the angle angle_min + i * angle_increment [rad] in the axes of the sensor, left positive.
 *
 * `ranges` [m], shape (n_ray,), as in REP 117: -inf is below range_min, +inf is no return within range_max.
 * `intensities`, shape (n_ray,). `time` is the time of the last ray; a rolling scan started `scan_time` earlier.
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
 * Rear red lamps: off, partial (with headlights), bright (brakes applied). Report, section 3.1.4.
 */
export enum TailLights { OFF = 0, PARTIAL = 1, BRIGHT = 2 }

/**
 * State of the lamps. `left_indicator` and `right_indicator`: whether the blinking lamp is lit now.
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
 * Ground truth of the wheels, shape (4,) each, in the order of `WHEEL_NAMES`.
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
 * The pinhole model of a camera, in pixels.
 *
 * A point (x, y, z) in the optical frame is at u = cx + fx x / z, v = cy + fy y / z, from the upper left corner of
 * the image; pixel (0, 0) covers 0 to 1 in both. `distortion` k1, k2, p1, p2, k3 is applied to x / z and y / z first
 * (Brown-Conrady, same as OpenCV and ROS 'plumb_bob').
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
 * One image, taken at `time` [s].
 *
 * `pose` is the pose of the optical frame (x right, y down, z forward, REP 103) in the map frame. `rgba`
 * uint8, shape (height, width, 4), C-contiguous, first row on top, sRGB; alpha is 255. If configured: `depth` [m]
 * float32, shape (height, width), along z of the optical frame, inf for no surface; `labels` uint8, same shape, see
 * `autodrive.graphics.assets.asset.Label`; `instances` uint16, same shape, the number of the object that the pixel
 * shows, see `World.instances`, 0 for none.
 */
export interface CameraImage {
  time: number
  pose: Pose
  intrinsics: CameraIntrinsics
  rgba: Uint8Array
  depth: Float32Array | null
  labels: Uint8Array | null
  instances: Uint16Array | null
}

/**
 * Distance to the nearest object in the cone of a range sensor around the x axis of the sensor.
 *
 * `range` [m] as in REP 117: -inf is below range_min, +inf is no return within range_max. `field_of_view` [rad] is the
 * full opening angle of the cone.
 */
export interface RangeReading {
  time: number
  range: number
  field_of_view: number
  range_min: number
  range_max: number
  radiation: 'ultrasound' | 'infrared'
}

/**
 * A vehicle in a race, ground truth. Times are in simulated seconds.
 *
 * `lap_count` completed laps of `lap_total`, with warm-up laps (0: without limit); `lap_time` in the present lap;
 * `last_lap_time`, and `best_lap_time` of the laps that count, are infinite until there is one. `race_time` of the
 * laps that count, so far, without `penalty` [s]. `collision_count` of the collisions that the rules count.
 * `checkpoint`: number of the checkpoint passed last in this lap, 0 before the first one. `distance` [m] along the
 * track since the start line; `rank` from 1; `gap` to the first vehicle [s].
 */
export interface RaceState {
  status: RaceStatus
  lap_count: number
  lap_total: number
  lap_time: number
  last_lap_time: number
  best_lap_time: number
  race_time: number
  penalty: number
  collision_count: number
  checkpoint: number
  distance: number
  rank: number
  gap: number
  is_wrong_way: boolean
}

/**
 * The reading of a sensor of the user: `values`, shape (n,), and the name of each in `columns`: 'distance [m]'.
 *
 * A value may be infinite or NaN.
 */
export interface OwnReading {
  time: number
  values: Float64Array
  columns: (string)[]
}

/**
 * The latest radio message of another vehicle: what it was at `sent` [s]; the message arrived at `received` [s].
 *
 * `position` [m], shape (3,), in the map frame, with the noise of the channel; `yaw` [rad]; `speed` [m/s], negative in
 * reverse; `steering` [rad], left positive.
 */
export interface HeardVehicle {
  sent: number
  received: number
  position: Float64Array
  yaw: number
  speed: number
  steering: number
  lights: Lights
}

/**
 * The latest radio message of a traffic light: what it showed at `sent` [s]; it arrived at `received` [s].
 *
 * `time_to_change` [s] counts from `sent`; None: it is not known or does not change.
 */
export interface HeardLight {
  sent: number
  received: number
  state: TrafficLightState
  time_to_change: number | null
}

/**
 * What a vehicle has heard by radio: the latest message of each vehicle and each traffic light, by name.
 */
export interface V2xReading {
  vehicles: Record<string, HeardVehicle>
  lights: Record<string, HeardLight>
}

/**
 * One vehicle at the time of the Frame: ground truth, actuator feedback, and the latest reading of every sensor.
 *
 * `pose` is the pose of the vehicle frame (origin: centre of the rear axle at wheel-centre height). `velocity` [m/s]
 * of its origin and `angular_velocity` [rad/s], shape (3,), are in vehicle axes. `throttle` [-1, 1] is the current
 * command of the drive actuators; `steering` [rad], left positive, is the angle of the steering actuator (report,
 * tables 2 and 3; sampled every tick). `lidar` is the latest scan, `range` the latest measurement of the range sensor;
 * None without such a sensor. `cameras` holds the latest image of each camera by its name ('front', 'rear'); it is
 * empty if cameras are off and before the first image, see `Images`. `race`: laps and times; None without a race.
 * `own` holds the latest reading of each sensor of the user by its name, see `World.add_sensor`. `v2x`: what it has
 * heard by radio; None without a channel in the scenario. `is_traffic`: it
 * is one of the cars of `ScenarioSpec.traffic`, which drive themselves.
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
  range: RangeReading | null
  race: RaceState | null
  own: Record<string, OwnReading>
  v2x: V2xReading | null
  is_traffic: boolean
}

/**
 * A movable object, for example a construction box.
 */
export interface ObjectFrame {
  pose: Pose
}

/**
 * What the weather of a Frame means for its first vehicle.
 *
 * `grip`: factor of the friction of its tyres. `sight` [m] infinite in clear air. `lidar_dark`, `lidar_bright`: range
 * of its LIDAR at a reflectivity of 10 % and of 80 % [m]; None without a LIDAR.
 */
export interface WeatherEffects {
  grip: number
  sight: number
  lidar_dark: number | null
  lidar_bright: number | null
}

/**
 * A traffic light: what it shows, and the time until that changes [s]; None: it is not known or does not change.
 *
 * `mode`: 'program', 'flashing' (yellow, as its program says at night), 'set' (by a request), or 'off'.
 */
export interface TrafficLightFrame {
  state: TrafficLightState
  time_to_change: number | null
  mode: 'off' | 'program' | 'flashing' | 'set'
}

/**
 * The world after a tick: `time` [s] since reset, number of ticks, vehicles and movable objects by name.
 *
 * `events` are the events of this tick, in order. `scene_light` is True by day. `time_of_day` is the time since
 * midnight [s], None if the light is fixed. `weather` and `weather_effects` are None under a clear sky over dry
 * ground. `traffic_lights` are those of the map, by name.
 */
export interface Frame {
  type: 'Frame'
  time: number
  tick: number
  vehicles: Record<string, VehicleFrame>
  objects: Record<string, ObjectFrame>
  events: (Collision | CollisionEnded | OffRoad | BackOnRoad | RedLight | StopSign | CheckpointPassed | LapCompleted | RacePenalty | SetBack | WrongWay | RaceStatusChanged)[]
  scene_light: boolean
  time_of_day: number | null
  weather: Weather | null
  weather_effects: WeatherEffects | null
  traffic_lights: Record<string, TrafficLightFrame>
}

/**
 * Sent several times a second, before the Welcome, while the server makes its world: what it does.
 *
 * `share`: of the stage that is done, 0 to 1. `remaining`: estimated time until its end [s]. None: not known.
 * `scene`, `frame`: the world at its start, for a picture until it runs; only in one message, as soon as it is known.
 * `scenario`: name of the scenario that is loaded. `has_start_screen`: as in the Welcome.
 */
export interface Starting {
  type: 'Starting'
  stage: string
  share: number | null
  remaining: number | null
  scene: Scene | null
  frame: Frame | null
  scenario: string
  has_start_screen: boolean
}

/**
 * The run that a simulator belongs to.
 *
 * `id`: random; no other run has it. `user`: login name of who started it. `started`: when, in seconds since 1970 UTC.
 */
export interface RunOrigin {
  id: string
  user: string
  started: number
}

/**
 * The answer to the Hello: versions, the display name of the client, and the scenarios that can be loaded.
 *
 * `folder`: name of the folder with files of the user, see `ListFiles`; empty: there is none. `run`: the run that the
 * simulator belongs to; None: an older simulator, which does not say. `title`: of the present scenario.
 * `has_start_screen`: the simulator was started without a scenario, and nobody has loaded one yet: a page offers them.
 */
export interface Welcome {
  type: 'Welcome'
  protocol: number
  version: string
  name: string
  scenarios: Record<string, string>
  folder: string
  run: RunOrigin | null
  title: string
  has_start_screen: boolean
}

/**
 * Shapes in the frame of their body, or in the map if they are fixed; arrays row after row.
 *
 * `kind` int64, shape (n,): 2 sphere, 5 cylinder, 6 box. `size` [m], shape (n, 3): radius; radius and half height
 * (axis z); half sizes. `position` of the centre [m], shape (n, 3); `rotation`: its matrix, row-major, shape (n, 9).
 */
export interface CollisionShapes {
  kind: BigInt64Array
  size: Float64Array
  position: Float64Array
  rotation: Float64Array
}

/**
 * Collision shapes by vehicle and object, the fixed ones, and sensors in the frame of their vehicle.
 *
 * Sent once after each Scene.
 */
export interface Shapes {
  type: 'Shapes'
  bodies: Record<string, CollisionShapes>
  fixed: CollisionShapes
  sensors: Record<string, Record<string, Pose>>
}

/**
 * State of the connection to a devkit script; `error` is the reason why there is none.
 */
export interface BridgeStatus {
  address: string
  state: 'closed' | 'connecting' | 'connected'
  error: string
  telemetry_rate: number
  command_rate: number
  round_trip: number | null
  devkit: string
  note: string
}

/**
 * State of the film that a `FilmRecording` has asked for.
 */
export interface FilmStatus {
  state: 'off' | 'filming' | 'done'
  name: string
  share: number
  error: string
}

/**
 * State of the recording that this simulator makes.
 */
export interface RecordingStatus {
  state: 'off' | 'recording' | 'keeping'
  file: string
  duration: number
  size: number
  dropped: number
  error: string
  download: string
  film: FilmStatus
}

/**
 * The episode of an environment that is shown, and how the cars have fared in those before it.
 */
export interface Episode {
  task: string
  number: number
  cars: Record<string, 'drives' | 'succeeded' | 'failed'>
  gap: number | null
  succeeded: number
  ended: number
}

/**
 * State of the simulation; sent four times a second, and at once when a setting changes.
 */
export interface Status {
  type: 'Status'
  is_paused: boolean
  speed: number | null
  real_time_factor: number
  late_ticks: number
  clients: number
  drivers: Record<string, string>
  bridge: BridgeStatus
  cameras_error: string
  note: string
  undo: string
  redo: string
  error: string
  recording: RecordingStatus
  position: number | null
  change: string
  changes: number
  clock: number
  refused: Record<string, string>
  cameras_note: string
  episode: Episode | null
}

/**
 * A new LIDAR scan; sent before the first Frame that it belongs to.
 */
export interface Scan {
  type: 'Scan'
  vehicle: string
  scan: LidarScan
}

/**
 * A drawing of that name; it is shown before the simulated time `until` [s]. None: it was removed.
 */
export interface Drawn {
  type: 'Drawn'
  name: string
  drawing: Drawing | null
  until: number
}

/**
 * Where the vehicles were between two Frames, ten times in a simulated second; sent before the second Frame.
 *
 * `times` [s], shape (n,). `positions` [m] by vehicle, as in `Pose`, one after the other, shape (3 n,).
 */
export interface Ways {
  type: 'Ways'
  times: Float64Array
  positions: Record<string, Float64Array>
}

/**
 * Forces on a vehicle, each with the part: the name of a wheel, or of what the body of the vehicle touches.
 *
 * `position` [m] and `force` [N], in the vehicle frame, row after row, shape (n, 3). Force of the ground on a wheel at
 * the end of the tick, as if the ground were level; mean over the tick of all contacts with another body.
 */
export interface ContactForces {
  parts: (string)[]
  position: Float64Array
  force: Float64Array
}

/**
 * Contact forces of each vehicle, of the latest tick; sent before a Frame.
 */
export interface Contacts {
  type: 'Contacts'
  vehicles: Record<string, ContactForces>
}

/**
 * A new image of a sensor camera as JPEG; sent before the first Frame that it belongs to.
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
 * An image of the scene camera that was set with `SetCamera`, at that simulated time [s].
 */
export interface Rendered {
  type: 'Rendered'
  time: number
  jpeg: Uint8Array
}

/**
 * What was requested with `ViewSensor`, at that simulated time [s].
 *
 * Depth has the colours of turbo from 0 to `farthest`, black beyond the last surface; labels those of
 * `Scene.label_colours`.
 */
export interface SensorView {
  type: 'SensorView'
  time: number
  jpeg: Uint8Array
}

/**
 * Least and greatest value of a plot in each column; NaN where there is no value.
 */
export interface Curve {
  low: Float64Array
  high: Float64Array
}

/**
 * A file of the user's folder, and its title.
 */
export interface OwnFile {
  kind: 'scenario' | 'map' | 'track'
  title: string
}

/**
 * A request succeeded; `frame` is the Frame after it, with all events since the last Frame sent.
 *
 * `text`: the scenario or map as YAML, for a `SaveScenario` or `SaveMap`; the path of the file, for a `StopRecording`
 * or `SaveRecording`; the name of the file, for a `SaveFile`; warnings, for an edit or an `ImportTrack`. `files`: by
 * name, for a `ListFiles`. `picture`: a PNG, for an `ExportMap`, whose YAML file is the `text`.
 * `curves`: by plot, for a `PlotRecording`; `text` says whether the recording is still being read.
 */
export interface Response {
  type: 'Response'
  id: number
  frame: Frame
  text: string
  curves: Record<string, Curve>
  files: Record<string, OwnFile>
  picture: Uint8Array
}

/**
 * A message or request failed; `text` says why and how to correct it. `id`: the request, None for other messages.
 *
 * `code`: 'version' (of the Hello), 'message' (not understood), 'request' (refused), 'taken' (another client drives
 * the vehicle), 'mode' (the vehicle obeys the other source), 'rate' (too many messages or clients).
 */
export interface Error {
  type: 'Error'
  code: 'version' | 'message' | 'request' | 'taken' | 'mode' | 'rate'
  text: string
  id: number | null
}

export type ServerOperation = Reset | Pause | Resume | Step | SetSpeed | Seek | Teleport | Hold | SetSceneLight | SetTimeOfDay | SetWeather | Draw | SetTrafficLight | SetDrivingMode | Retire | LoadScenario | Place | AddBox | RemoveBox | SetSensor | RemoveTraffic | EditMap | UseMap | CloseLoop | InsertModule | EditTrack | GenerateTrack | Undo | Redo | SaveScenario | SaveMap | ConnectBridge | DisconnectBridge | SetCamera | ViewSensor | LetDrive | DescribeWeather | DescribeVehicle | StartRecording | StopRecording | SaveRecording | FilmRecording | ReplayRecording | PlotRecording | ImportTrack | OpenFile | ListFiles | SaveFile | ExportMap

export type Event = Collision | CollisionEnded | OffRoad | BackOnRoad | RedLight | StopSign | CheckpointPassed | LapCompleted | RacePenalty | SetBack | WrongWay | RaceStatusChanged

export type MapPart = MapModule | MapWall | MapBlock | MapProp

export type ClientMessage = Hello | Subscribe | Drive | Release | Request

export type ServerMessage = Starting | Welcome | Scene | Shapes | Status | Scan | Drawn | Ways | Contacts | Picture | Rendered | SensorView | Response | Error | Frame

/** The weathers that have a name, in the order of the devkit. */
export const WEATHERS: Record<string, Weather> = {
  "sunny": {
    "clouds": 0.0,
    "fog": 0.0,
    "rain": 0.0,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "cloudy": {
    "clouds": 0.8,
    "fog": 0.0,
    "rain": 0.0,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "light_fog": {
    "clouds": 0.3,
    "fog": 0.3,
    "rain": 0.0,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "heavy_fog": {
    "clouds": 0.5,
    "fog": 0.8,
    "rain": 0.0,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "light_rain": {
    "clouds": 0.7,
    "fog": 0.0,
    "rain": 0.3,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "heavy_rain": {
    "clouds": 1.0,
    "fog": 0.0,
    "rain": 0.8,
    "snow": 0.0,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "light_snow": {
    "clouds": 0.7,
    "fog": 0.0,
    "rain": 0.0,
    "snow": 0.3,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  },
  "heavy_snow": {
    "clouds": 1.0,
    "fog": 0.0,
    "rain": 0.0,
    "snow": 0.8,
    "wind": 0.0,
    "wetness": null,
    "snow_cover": null
  }
}
