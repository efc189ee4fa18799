// The latest of all that the server said and that the person chose. Scene and panels read it; they do not know each other.
import type { Event, Frame, LidarScan, Picture, Scene, Status, Welcome } from './messages'
import { Signal } from './signal'

export type Link = 'connecting' | 'open' | 'lost'
export type Camera = "Driver's Eye" | "Bird's Eye" | "God's Eye" | 'Orbit'
export type Quality = 'auto' | 'low' | 'high' | 'ultra' | 'stream'

/** Pictures that are drawn by the simulator, an object URL, while the quality is 'stream'. */
export interface Rendered {
  time: number
  jpeg: Uint8Array
}

export class Store {
  readonly link = new Signal<Link>('connecting')
  readonly welcome = new Signal<Welcome | null>(null)
  readonly scene = new Signal<Scene | null>(null)
  readonly status = new Signal<Status | null>(null)
  readonly frame = new Signal<Frame | null>(null)
  /** The latest scan of each vehicle, filled before the Frame that it belongs to. */
  readonly scans = new Map<string, LidarScan>()
  /** The latest picture by `vehicle/camera`, likewise. */
  readonly pictures = new Map<string, Picture>()
  readonly rendered = new Signal<Rendered | null>(null)
  /** What has just happened in the world. */
  readonly events = new Signal<readonly Event[]>([])
  /** How often this page had the simulation reset. */
  readonly resets = new Signal(0)
  /** Why there is no connection, while there is none. */
  readonly lost = new Signal('')
  /** What the person is told in a line, for example that somebody else drives. */
  readonly notice = new Signal('')

  /** Name of the vehicle that is watched and driven. */
  readonly vehicle = new Signal('')
  readonly camera = new Signal<Camera>("Driver's Eye")
  /** Of the Bird's Eye [m]. */
  readonly birdHeight = new Signal(3)
  readonly quality = new Signal<Quality>('auto')
  readonly isMenuOpen = new Signal(false)
  readonly isHudOpen = new Signal(false)
  /** Whether the LIDAR's scan is drawn in the scene. */
  readonly isScanShown = new Signal(true)
  /** Pictures of the page in a second, the mean of the last half [Hz]. */
  readonly frameRate = new Signal(0)
}
