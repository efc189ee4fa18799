// The latest messages of the server and the choices of the user; the interface between connection, scene and panels.
import { CalmEvents } from './calm_events'
import type {
  ContactForces,
  Drawn,
  Event,
  Frame,
  LidarScan,
  OwnFile,
  Picture,
  Scene,
  Shapes,
  Starting,
  Status,
  Ways,
  Welcome,
} from './messages'
import { GuardedSwitch, Observable } from './observable'

export type Link = 'connecting' | 'starting' | 'open' | 'lost'
export type Camera = "Driver's Eye" | "Bird's Eye" | "God's Eye" | 'Orbit' | 'Fly'
export type Quality = 'auto' | 'low' | 'high' | 'ultra' | 'stream'

/** Place of the Orbit camera around the middle of the vehicle, along the axes of the map [rad, m]. */
export interface Orbit {
  azimuth: number
  elevation: number
  distance: number
}

/** Place [m] and direction [rad] of the fly camera in the map; azimuth 0 looks along x, elevation is positive upwards. */
export interface Fly {
  x: number
  y: number
  z: number
  azimuth: number
  elevation: number
}

/** What moves the fly camera, each from -1 to 1: ahead, to its left, upwards; turning left, turning upwards. */
export interface FlyInput {
  ahead: number
  left: number
  up: number
  turn: number
  tilt: number
  isFast: boolean
}

/** An image rendered by the simulator, at a simulated time [s]. */
export interface Rendered {
  time: number
  jpeg: Uint8Array
}

/** Where a vehicle or an object stands: position [m] and heading [rad]. */
export interface Placement {
  name: string
  x: number
  y: number
  yaw: number
}

export class Store {
  readonly link = new Observable<Link>('connecting')
  /** Why the page must be loaded again; empty: it need not. */
  readonly reloadReason = new Observable('')
  /** How far the start of the simulator is, while the link is 'starting'. */
  readonly starting = new Observable<Starting | null>(null)
  readonly welcome = new Observable<Welcome | null>(null)
  /** The files of the user's folder, by name; null: there is no folder. */
  readonly files = new Observable<Record<string, OwnFile> | null>(null)
  readonly scene = new Observable<Scene | null>(null)
  readonly status = new Observable<Status | null>(null)
  readonly frame = new Observable<Frame | null>(null)
  /** Where the vehicles were since the Frame before; set before the Frame that ends it. */
  readonly ways = new Observable<Ways | null>(null)
  /** The latest scan of each vehicle; set before the Frame that it belongs to. */
  readonly scans = new Map<string, LidarScan>()
  /** The latest camera image by `vehicle/camera`; set before the Frame that it belongs to. */
  readonly cameraImages = new Map<string, Picture>()
  /** What scripts have drawn, by name; `drawingChanges` counts the changes. */
  readonly drawings = new Map<string, Drawn>()
  readonly drawingChanges = new Observable(0)
  /** Collision shapes and sensors of the Scene, while they are asked for. */
  readonly shapes = new Observable<Shapes | null>(null)
  /** The latest contact forces by vehicle, while they are asked for. */
  readonly contacts = new Observable<Record<string, ContactForces>>({})
  /** Force of an arrow of 10 cm [N]; 0: not known yet. */
  readonly forceScale = new Observable(0)
  readonly rendered = new Observable<Rendered | null>(null)
  /** The latest depth or labels of a sensor camera that the HUD has asked for. */
  readonly sensorView = new Observable<Rendered | null>(null)
  /** Depth at which its colours end [m]. */
  readonly depthFarthest = new Observable(0)
  /** Whether the first image of the simulator's renderer is awaited. */
  readonly isStreamStarting = new Observable(false)
  /** Whether the page draws the scene itself although the quality is Stream: the camera looks at the map. */
  readonly isStreamPaused = new Observable(false)
  /** The latest events of the world. */
  readonly events = new Observable<readonly Event[]>([])
  /** The events that people are told: without a vehicle that comes back to the road for a moment only. */
  readonly told = new Observable<readonly Event[]>([])
  /** Number of resets by this page. */
  readonly resets = new Observable(0)
  /** Why there is no connection. */
  readonly connectionError = new Observable('')
  /** A message for the user, for example that another client drives. */
  readonly notice = new Observable('')
  /** Why a request of the user failed; it stays until it is closed. */
  readonly error = new Observable('')
  /** A message about something else that failed. */
  readonly warning = new Observable('')

  /** Name of the selected vehicle, which the camera follows and the user drives. */
  readonly vehicle = new Observable('')
  readonly camera = new Observable<Camera>("Driver's Eye")
  /** Height of the Bird's Eye camera [m]. */
  readonly birdHeight = new Observable(3)
  /** Focal length of the cameras that do not move when they zoom, relative to the standard one. */
  readonly lensZoom = new Observable({ "Driver's Eye": 1, "God's Eye": 1 })
  /** Null: the standard place behind the vehicle, at the first image. */
  readonly orbit = new Observable<Orbit | null>(null)
  /** Null: the place of the camera before it, at the first image. */
  readonly fly = new Observable<Fly | null>(null)
  /** What moves the fly camera. */
  readonly flyInput: FlyInput = { ahead: 0, left: 0, up: 0, turn: 0, tilt: 0, isFast: false }
  readonly quality = new Observable<Quality>('auto')
  /** The quality that the page or the simulator chose because another one is not possible. */
  fallbackQuality: Quality | null = null
  /** Whether the start screen is shown, with the scenarios that can be entered. */
  readonly isStartOpen = new Observable(false)
  /** The vehicle that the driver of the simulator drives for this page; empty: none. */
  readonly watched = new Observable('')
  /** Whether the camera turns slowly around the map, behind the start screen of the first visit. */
  readonly isTurning = new Observable(false)
  readonly isMenuOpen = new Observable(false)
  readonly isHudOpen = new Observable(false)
  readonly isLogOpen = new Observable(false)
  /** Whether the small map is shown. */
  readonly isMapOpen = new Observable(false)
  /** Whether the driven lines are drawn in the scene and on the small map. */
  readonly areTrailsShown = new Observable(false)
  /** Whether the drawings of scripts are shown in the scene. */
  readonly areDrawingsShown = new Observable(true)
  /** Whether the names of vehicles are shown above them. */
  readonly areLabelsShown = new Observable(true)
  /** Whether the collision shapes, contact forces, and axes of vehicles and sensors are drawn in the scene. */
  readonly areShapesShown = new Observable(false)
  readonly areForcesShown = new Observable(false)
  readonly areAxesShown = new Observable(false)
  /** Whether a screen reader gets the scene in words. */
  readonly isDescribed = new Observable(false)
  /** Whether a click on the ground sets a point of a measured distance. */
  readonly isMeasuring = new Observable(false)
  /** Operations that may not be requested now, with the reason, by their name. */
  readonly refused = new Observable<Readonly<Record<string, string>>>({})
  readonly isEditing = new GuardedSwitch(
    () => this.refused.value.Place ?? '',
    (reason) => (this.notice.value = reason),
  )
  /** Whether the map is being built; never together with `isEditing`. */
  readonly isBuilding = new GuardedSwitch(
    () => this.refused.value.UseMap ?? '',
    (reason) => (this.notice.value = reason),
  )
  /** Name of the vehicle or object that is selected in Edit mode; empty: none. */
  readonly selection = new Observable('')
  /** Whether the scenario has edits that this page has not saved in a file. */
  readonly hasUnsavedEdits = new Observable(false)
  /** Where the selected thing is shown while it is moved. */
  readonly preview = new Observable<Placement | null>(null)
  /** Whether the LIDAR scan is drawn in the scene. */
  readonly isScanShown = new Observable(true)
  /** Range at which the colours of the LIDAR points end [m]; 0: there are none yet. */
  readonly scanFarthest = new Observable(0)
  /** Direction of the LIDAR measurement of the HUD in the vehicle frame [rad], left positive. */
  readonly bearing = new Observable(0)
  /** Frame rate of the 3D view, averaged over half a second [Hz]. */
  readonly frameRate = new Observable(0)
  /** The Scene of the latest image of the 3D view. */
  readonly shownScene = new Observable<Scene | null>(null)
  /** How much of the present Scene has been loaded [bytes]. */
  readonly sceneBytes = new Observable(0)
  /** Changes with each image of the 3D view, after its cameras have moved. */
  readonly imageCount = new Observable(0)

  constructor() {
    const pair = [this.isEditing, this.isBuilding]
    for (const [i, one] of pair.entries())
      one.watch((isOn) => {
        if (isOn) pair[1 - i].value = false
      })
    const calm = new CalmEvents()
    const tell = (events: readonly Event[]) => {
      // an environment has rules of its own: what those of the road say means nothing in it
      const known = this.status.value?.episode ? events.filter(({ type }) => type.startsWith('Collision')) : events
      const told = calm.at(this.frame.value?.time ?? 0, known)
      if (told.length > 0) this.told.value = told
    }
    this.events.watch(tell)
    this.frame.watch(() => tell([]))
    this.scene.watch(() => calm.clear())
    this.status.watch((status) => {
      const refused = status?.refused ?? {}
      if (JSON.stringify(refused) === JSON.stringify(this.refused.value)) return
      this.refused.value = refused
      if (refused.Place) this.isEditing.value = false
      if (refused.UseMap) this.isBuilding.value = false
    })
  }

  /** Whether keys and pads move the fly camera, instead of driving. */
  get isFlying(): boolean {
    return this.camera.value === 'Fly' && !this.isMapViewed
  }

  /** Whether the camera looks at the map, for Edit mode and Build mode. */
  get isMapViewed(): boolean {
    return this.isEditing.value || this.isBuilding.value
  }

  /** Calls `onChange` when anything changes that an image of the 3D view depends on, except the Frame, which moves what
   * is shown; returns functions that end this. */
  watchImage(onChange: () => void): (() => void)[] {
    const others: unknown[] = [this.frame, this.status, this.frameRate, this.imageCount, this.shownScene, this.ways]
    const shown = Object.values(this).filter((value) => value instanceof Observable && !others.includes(value))
    return shown.map((observable: Observable<unknown>) => {
      let before = observable.value
      return observable.watch((value) => {
        if (value !== before) onChange()
        before = value
      })
    })
  }
}
