// The actions of the user, called by buttons and keys. A failed request is shown as a notice.
import type { Connection } from './connection'
import { keyText } from './driving/key_caps'
import type { Response, ServerOperation } from './messages'
import { clamp } from './scene/clamp'
import type { SceneView } from './scene/view'
import { zoomCamera } from './scene/zoom'
import type { Camera, Store } from './store'

export const CAMERAS: readonly Camera[] = ["Driver's Eye", "Bird's Eye", "God's Eye", 'Orbit', 'Fly']

const FLYING =
  'Keys and pads move the camera, not the vehicle: {KeyW} {KeyA} {KeyS} {KeyD}, arrows, Page Up, Page Down; Shift: faster.'
/** [rad] */
const ORBIT_STEP = Math.PI / 36

/** Operations that the traffic of the scenario can forbid. */
const MAP_EDITS = new Set(['EditMap', 'UseMap', 'EditTrack', 'GenerateTrack', 'ImportTrack', 'OpenFile'])

/** What a request gave, or the problems because of which it failed. */
export interface Attempt {
  response: Response | null
  text: string | null
  errors: readonly string[]
}

export class Actions {
  /** The 3D view, as soon as it is loaded. */
  view: SceneView | null = null

  constructor(
    private readonly store: Store,
    private readonly connection: Connection,
  ) {}

  /** Sends a request to the simulator; returns whether it succeeded. */
  async request(operation: ServerOperation): Promise<boolean> {
    return (await this.textOf(operation)) !== null
  }

  /** Sends a request; returns the text of its Response, or null if it failed. */
  async textOf(operation: ServerOperation): Promise<string | null> {
    const { text, errors } = await this.attempt(operation)
    for (const problem of errors) this.store.error.value = problem
    return text
  }

  /** Asks whether the traffic, which forbids an edit of the map, may be removed; the argument says why. */
  mayRemoveTraffic: (why: string) => Promise<boolean> = () => Promise.resolve(false)

  /** Sends a request; returns its Response and its text, or why it failed.
   *
   * If the traffic forbids an edit of the map, the user may remove the traffic.
   */
  async attempt(operation: ServerOperation): Promise<Attempt> {
    const result = await this.attemptOnce(operation)
    const why = result.errors.find((error) => /traffic/i.test(error))
    const hasTraffic = Object.values(this.store.frame.value?.vehicles ?? {}).some(({ is_traffic }) => is_traffic)
    if (!why || !hasTraffic || !MAP_EDITS.has(operation.type)) return result
    if (!(await this.mayRemoveTraffic(why))) return { ...result, errors: [] } // the question said why
    const removed = await this.attemptOnce({ type: 'RemoveTraffic' })
    return removed.response ? this.attemptOnce(operation) : removed
  }

  private async attemptOnce(operation: ServerOperation): Promise<Attempt> {
    try {
      const response = await this.connection.request(operation)
      return { response, text: response.text, errors: [] }
    } catch (error) {
      return { response: null, text: null, errors: problems(error) }
    }
  }

  async reset(): Promise<void> {
    if (await this.request({ type: 'Reset' })) {
      this.store.resets.value += 1
      this.store.notice.value = 'Reset to the initial state.'
    }
  }

  nextCamera(): void {
    this.store.camera.value = next(CAMERAS, this.store.camera.value)
    if (this.store.isFlying) this.store.notice.value = keyText(FLYING)
  }

  /** Moves the camera nearer by a click of the mouse wheel, or farther: -1. */
  zoom(click: 1 | -1): void {
    if (this.store.isMapViewed) this.view?.zoomEdit(click)
    else zoomCamera(this.store, click)
  }

  /** Turns the Orbit camera, which is selected, by steps to the right and upwards. */
  orbit(right: number, up: number): void {
    const { camera, orbit } = this.store
    camera.value = 'Orbit'
    if (!orbit.value) return // its first image sets its standard place
    const elevation = clamp(orbit.value.elevation + up * ORBIT_STEP, [0.03, 0.5 * Math.PI])
    orbit.value = { ...orbit.value, azimuth: orbit.value.azimuth + right * ORBIT_STEP, elevation }
  }

  nextVehicle(): void {
    const vehicles = Object.keys(this.store.scene.value?.vehicles ?? {})
    if (vehicles.length === 0) return
    this.store.vehicle.value = next(vehicles, this.store.vehicle.value)
    const viewed = this.store.vehicle.value
    this.store.notice.value = vehicles.length > 1 ? `${viewed} is viewed now.` : `${viewed} is the only vehicle.`
  }

  /** Downloads the present image of the 3D view as a PNG file. */
  async downloadView(): Promise<void> {
    const picture = await this.view?.picture()
    if (!picture) {
      this.store.warning.value = 'There is no image yet.'
      return
    }
    const link = document.createElement('a')
    link.href = URL.createObjectURL(picture)
    link.download = `${this.store.scene.value?.scenario}-${this.store.frame.value?.time.toFixed(2)}s.png`
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 1000)
    this.store.notice.value = `Saved ${link.download}.`
  }

  toggleSceneLight(): void {
    const frame = this.store.frame.value
    if (frame) void this.request({ type: 'SetSceneLight', enabled: !frame.scene_light })
  }

  toggleMode(): void {
    const vehicle = this.store.vehicle.value
    const frame = this.store.frame.value?.vehicles[vehicle]
    if (frame) void this.request({ type: 'SetDrivingMode', vehicle, is_autonomous: !frame.is_autonomous })
  }

  togglePause(): void {
    const status = this.store.status.value
    if (status) void this.request({ type: status.is_paused ? 'Resume' : 'Pause' })
  }

  /** Pauses the simulation if it runs, then runs that many ticks. */
  async step(ticks: number): Promise<void> {
    const isPaused = this.store.status.value?.is_paused || (await this.request({ type: 'Pause' }))
    if (isPaused) await this.request({ type: 'Step', ticks })
  }
}

/** The message of an error as a sentence. */
export function sentence(error: unknown): string {
  const text = error instanceof Error ? error.message : String(error)
  return text.charAt(0).toUpperCase() + text.slice(1) + (/[.!?)]$/.test(text) ? '' : '.')
}

/** The problems that an error lists, each as a sentence without paths of files. */
export function problems(error: unknown): string[] {
  const text = error instanceof Error ? error.message : String(error)
  return text
    .replace(/^\d+ errors:\n/, '')
    .split(/\n\s*- /)
    .map((line) => sentence(withoutPath(line.replace(/^\s*- /, ''))))
}

const SIZES: Record<string, string> = { 'size 1': 'length', 'size 2': 'width', 'size 3': 'height' }

/** 'vehicles.V1.sensors.imu.rate: must be ...' becomes 'the rate of imu of V1 must be ...'. */
function withoutPath(line: string): string {
  const limit = /Expected `\w+` (<=|>=) ([-\d.e+]+) - at `\$\.operation\.(\w+)`/.exec(line)
  if (limit) return `${limit[3]} must be at ${limit[1] === '<=' ? 'most' : 'least'} ${Number(limit[2])}`
  const [, path, text] = /^((?:vehicles|boxes)\.\S+(?: \d+)?)(?: \(line \d+\))?: (.*)$/s.exec(line) ?? []
  if (!path) return line
  if (!text.startsWith('must')) return text
  const [last, ...owners] = path.split('.').slice(1).reverse()
  return `the ${[SIZES[last] ?? last, ...owners.filter((one) => one !== 'sensors')].join(' of ')} ${text}`
}

function next<T>(all: readonly T[], one: T): T {
  return all[(all.indexOf(one) + 1) % all.length]
}
