// Cameras of the 3D view: the scene cameras of cameras/viewpoints.py, a free orbit, and a camera that flies.
import { Euler, Matrix4, PerspectiveCamera, Quaternion, Vector3 } from 'three'
import { OrbitControls } from 'three/addons/controls/OrbitControls.js'

import type { Scene } from '../messages'
import type { Camera, Fly, Orbit, Store } from '../store'
import { flown, within } from './flight'
import type { PlacedObject } from './motion'
import { ORBIT_DISTANCE } from './zoom'

const DEGREE = Math.PI / 180

/** Scene cameras as described by a Scene: lengths [m], angles [degree], times [s]. */
interface Lens {
  field_of_view: number
  near: number
  far: number
}
interface DriversEye extends Lens {
  position: [number, number, number]
  pitch: number
}
interface GodsEye extends Omit<Lens, 'field_of_view'> {
  position: [number, number, number]
  zoom: number
  turn_time: number
  zoom_time: number
}
type FreeShare = (from: Vector3, to: Vector3) => number
interface ViewSettings {
  height: number
  halfLength: number
  zoom: number
  freeShare?: FreeShare
}
const UP = new Vector3(0, 0, 1)
/** Rotation from the axes of a three.js camera (looks along -z, y up) to ours (looks along x, z up). */
const CAMERA = new Quaternion().setFromRotationMatrix(
  new Matrix4().makeBasis(new Vector3(0, -1, 0), UP, new Vector3(-1, 0, 0)),
)
const FROM_CAMERA = CAMERA.clone().invert()
/** Standard place of the orbit [m, rad]: behind and above, a little to the side. */
const ORBIT = { distance: 1.15, elevation: 0.5, aside: 0.45 }
/** Smaller changes of the orbit [rad, m] are rounding errors. */
const ORBIT_PRECISION = 1e-6
/** After this time, half of a movement of the orbit is left, at any rate of images [s]. */
const ORBIT_HALF_TIME = 0.09
/** Target of the orbit, relative to the centre of the rear axle [m]. */
const ORBIT_TARGET_AHEAD = 0.07
const ORBIT_TARGET_HEIGHT = 0.05
/** The slow turn around a map: distance as a share of its larger side, elevation and rate [rad, rad/s]. */
const TURN = { distance: 0.62, elevation: 0.5, rate: 0.05, start: -2.2 }

export class Viewpoints {
  readonly camera = new PerspectiveCamera(60, 16 / 9, 0.01, 1000)
  readonly controls: OrbitControls
  private readonly orbitCamera = new PerspectiveCamera(60, 16 / 9, 0.02, 1000)
  private godState: { pan: number; tilt: number; zoom: number } | null = null
  private placed: Orbit | null = null
  private hasLooked = false
  private turned = TURN.start

  /** `store` has the places of Orbit and Fly, which the user changes here or elsewhere. */
  constructor(
    canvas: HTMLElement,
    private readonly store: Pick<Store, 'orbit' | 'fly' | 'flyInput'>,
  ) {
    this.orbitCamera.up.copy(UP)
    this.controls = new OrbitControls(this.orbitCamera, canvas)
    this.controls.enabled = false
    this.controls.enablePan = false
    this.controls.enableDamping = true
    ;[this.controls.minDistance, this.controls.maxDistance] = ORBIT_DISTANCE
    this.controls.maxPolarAngle = 0.5 * Math.PI - 0.02
  }

  /** Restarts the cameras that depend on earlier poses, after another scenario was loaded. */
  restart(): void {
    this.godState = null
  }

  /**
   * Advances the camera by `dt` [s]; `height` [m] of the Bird's Eye, `halfLength` [m] of the vehicle. `freeShare`: of the
   * way from a point to another, which the orbit does not go beyond.
   */
  update(
    name: Camera,
    scene: Scene,
    vehicle: PlacedObject,
    dt: number,
    { height, halfLength, zoom, freeShare = () => 1 }: ViewSettings,
  ): void {
    this.controls.enabled = name === 'Orbit'
    if (name !== "God's Eye") this.godState = null
    if (name === 'Fly' && (this.hasLooked || this.store.fly.value)) this.flyOn(dt)
    else if (name === 'Orbit') this.orbitVehicle(vehicle, dt, freeShare)
    else if (name === "Driver's Eye" || name === 'Fly')
      this.driversEye(scene.scene_cameras["Driver's Eye"] as DriversEye, vehicle)
    else if (name === "Bird's Eye") this.birdsEye(scene.scene_cameras[name] as unknown as Lens, vehicle, height)
    else this.godsEye(scene.scene_cameras[name] as GodsEye, vehicle, dt, halfLength)
    this.hasLooked = true
    this.camera.zoom = zoom
    this.camera.updateProjectionMatrix()
    this.camera.updateMatrixWorld()
  }

  /** Turns slowly around the middle of the map, by `dt` [s]; a user who wants no motion sees it from one place. */
  turn({ plan }: Scene, dt: number): void {
    const [left, bottom, right, top] = plan?.bounds ?? [-2, -2, 2, 2]
    const distance = TURN.distance * Math.max(right - left, top - bottom)
    if (!matchMedia('(prefers-reduced-motion: reduce)').matches) this.turned += TURN.rate * dt
    this.controls.enabled = false
    this.setLens(this.orbitCamera.fov, this.orbitCamera.near, this.orbitCamera.far)
    this.camera.position
      .copy(fromOrbit({ azimuth: this.turned, elevation: TURN.elevation, distance }))
      .add(offset.set(0.5 * (left + right), 0.5 * (bottom + top), 0))
    this.setDirection(this.turned + Math.PI, TURN.elevation)
    this.camera.zoom = 1
    this.camera.updateProjectionMatrix()
    this.camera.updateMatrixWorld()
  }

  private setLens(fieldOfView: number, near: number, far: number): void {
    this.camera.fov = fieldOfView
    this.camera.near = near
    this.camera.far = far
  }

  private setDirection(pan: number, tilt: number): void {
    this.camera.quaternion.setFromEuler(euler.set(0, tilt, pan, 'ZYX')).multiply(CAMERA)
  }

  private driversEye(spec: DriversEye, vehicle: PlacedObject): void {
    this.setLens(spec.field_of_view, spec.near, spec.far)
    this.camera.position.fromArray(spec.position).applyQuaternion(vehicle.orientation).add(vehicle.position)
    this.setDirection(0, spec.pitch * DEGREE)
    this.camera.quaternion.premultiply(vehicle.orientation)
  }

  private birdsEye(spec: Lens, vehicle: PlacedObject, height: number): void {
    this.setLens(spec.field_of_view, spec.near, spec.far)
    this.camera.position.set(vehicle.position.x, vehicle.position.y, height)
    this.setDirection(0, 0.5 * Math.PI)
  }

  private godsEye(spec: GodsEye, vehicle: PlacedObject, dt: number, halfLength: number): void {
    this.camera.position.fromArray(spec.position)
    const to = offset.subVectors(vehicle.position, this.camera.position)
    const level = Math.hypot(to.x, to.y)
    const before = this.godState
    const pan = level > 1e-9 ? Math.atan2(to.y, to.x) : (before?.pan ?? 0) // undefined if the vehicle is exactly below
    const tilt = Math.atan2(-to.z, level)
    const zoom = Math.min((spec.zoom * Math.atan2(halfLength, to.length())) / DEGREE, 170)
    const state = before ?? { pan, tilt, zoom }
    this.godState = state
    const turned = -Math.expm1(-dt / spec.turn_time)
    const turn = pan - state.pan
    state.pan += turned * (turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI)))
    state.tilt += turned * (tilt - state.tilt)
    state.zoom -= Math.expm1(-dt / spec.zoom_time) * (zoom - state.zoom)
    this.setLens(state.zoom, spec.near, spec.far)
    this.setDirection(state.pan, state.tilt)
  }

  /** Moves the fly camera; it starts where the camera before it was. */
  private flyOn(dt: number): void {
    const { fly, flyInput } = this.store
    fly.value ??= this.present()
    const now = flown(fly.value, flyInput, dt)
    if (now !== fly.value) fly.value = now
    this.setLens(this.orbitCamera.fov, this.orbitCamera.near, this.orbitCamera.far)
    this.camera.position.set(now.x, now.y, now.z)
    this.setDirection(now.azimuth, -now.elevation)
  }

  /** Where the camera is now, for the fly camera. */
  private present(): Fly {
    const { position, quaternion } = this.camera
    const { y: tilt, z: azimuth } = euler.setFromQuaternion(turned.copy(quaternion).multiply(FROM_CAMERA), 'ZYX')
    return within({ ...{ x: position.x, y: position.y, z: position.z }, azimuth, elevation: -tilt })
  }

  private orbitVehicle(vehicle: PlacedObject, dt: number, freeShare: FreeShare): void {
    const target = offset
      .set(ORBIT_TARGET_AHEAD, 0, ORBIT_TARGET_HEIGHT)
      .applyQuaternion(vehicle.orientation)
      .add(vehicle.position)
    const { position, fov, near, far } = this.orbitCamera
    this.store.orbit.value ??= behind(vehicle)
    if (this.store.orbit.value === this.placed) position.add(target).sub(this.controls.target)
    else position.copy(target).add(fromOrbit(this.store.orbit.value))
    this.controls.target.copy(target)
    this.controls.dampingFactor = 1 - 0.5 ** (dt / ORBIT_HALF_TIME)
    this.controls.update()
    const before = this.store.orbit.value
    const now = toOrbit(target.subVectors(position, target))
    const aside = Math.abs(Math.sin(0.5 * (now.azimuth - before.azimuth)))
    const moved = Math.max(aside, Math.abs(now.elevation - before.elevation), Math.abs(now.distance - before.distance))
    this.placed = moved > ORBIT_PRECISION ? now : before
    if (this.placed !== before) this.store.orbit.value = this.placed
    this.setLens(fov, near, far)
    this.camera.position.copy(this.controls.target).lerp(position, freeShare(this.controls.target, position))
    this.camera.quaternion.copy(this.orbitCamera.quaternion)
  }

  dispose(): void {
    this.controls.dispose()
  }
}

/** The standard orbit of a vehicle. */
function behind(vehicle: PlacedObject): Orbit {
  const heading = euler.setFromQuaternion(vehicle.orientation, 'ZYX').z
  return { azimuth: heading + Math.PI - ORBIT.aside, elevation: ORBIT.elevation, distance: ORBIT.distance }
}

function fromOrbit({ azimuth, elevation, distance }: Orbit): Vector3 {
  const level = distance * Math.cos(elevation)
  return around.set(level * Math.cos(azimuth), level * Math.sin(azimuth), distance * Math.sin(elevation))
}

function toOrbit({ x, y, z }: Vector3): Orbit {
  const level = Math.hypot(x, y)
  return { azimuth: Math.atan2(y, x), elevation: Math.atan2(z, level), distance: Math.hypot(level, z) }
}

const euler = new Euler()
const turned = new Quaternion()
const offset = new Vector3()
const around = new Vector3()
