// From where people look at the scene: the scene cameras of render/viewpoints.py, and a free orbit.
import { Euler, Matrix4, PerspectiveCamera, Quaternion, Vector3 } from 'three'
import { OrbitControls } from 'three/addons/controls/OrbitControls.js'

import type { Scene } from '../messages'
import type { Camera } from '../store'
import type { Placed } from './motion'

const DEGREE = Math.PI / 180
const UP = new Vector3(0, 0, 1)
/** Three.js cameras look along -z with y up; ours along x with z up. */
const CAMERA = new Quaternion().setFromRotationMatrix(
  new Matrix4().makeBasis(new Vector3(0, -1, 0), UP, new Vector3(-1, 0, 0)),
)
/** How the orbit begins: behind and above, a little to the side [m, rad]. */
const ORBIT = { distance: 1.15, elevation: 0.5, aside: 0.45, lowest: 0.15, farthest: 12 }
/** What the orbit looks at, over the centre of the rear axle in the middle of the car [m]. */
const ORBIT_AHEAD = 0.07
const ORBIT_ABOVE = 0.05

export class Viewpoints {
  readonly camera = new PerspectiveCamera(60, 16 / 9, 0.01, 1000)
  readonly controls: OrbitControls
  private readonly orbit = new PerspectiveCamera(60, 16 / 9, 0.02, 1000)
  private god: { pan: number; tilt: number; zoom: number } | null = null
  private isOrbiting = false

  constructor(canvas: HTMLElement) {
    this.orbit.up.copy(UP)
    this.controls = new OrbitControls(this.orbit, canvas)
    this.controls.enabled = false
    this.controls.enablePan = false
    this.controls.enableDamping = true
    this.controls.dampingFactor = 0.12
    this.controls.minDistance = ORBIT.lowest
    this.controls.maxDistance = ORBIT.farthest
    this.controls.maxPolarAngle = 0.5 * Math.PI - 0.02
  }

  /** Another scenario, or the world was reset: nothing follows what was. */
  restart(): void {
    this.god = null
    this.isOrbiting = false
  }

  /** Moves the camera to where it is `dt` [s] later; `height` [m] of the Bird's Eye, `halfLength` [m] of the car. */
  update(name: Camera, scene: Scene, car: Placed, dt: number, height: number, halfLength: number): void {
    const eye = scene.scene_cameras[name]
    this.controls.enabled = name === 'Orbit'
    if (name !== "God's Eye") this.god = null
    if (name === 'Orbit') this.follow(car)
    else if (name === "Driver's Eye") this.drive(eye, car)
    else if (name === "Bird's Eye") this.fly(eye, car, height)
    else this.watch(eye, car, dt, halfLength)
    this.camera.updateProjectionMatrix()
    this.camera.updateMatrixWorld()
  }

  private see(fieldOfView: number, near: number, far: number): void {
    this.camera.fov = fieldOfView
    this.camera.near = near
    this.camera.far = far
  }

  private look(pan: number, tilt: number): void {
    this.camera.quaternion.setFromEuler(euler.set(0, tilt, pan, 'ZYX')).multiply(CAMERA)
  }

  private drive(eye: Record<string, any>, car: Placed): void {
    this.see(eye.field_of_view, eye.near, eye.far)
    this.camera.position.fromArray(eye.position).applyQuaternion(car.orientation).add(car.position)
    this.look(0, eye.pitch * DEGREE)
    this.camera.quaternion.premultiply(car.orientation)
  }

  private fly(eye: Record<string, any>, car: Placed, height: number): void {
    this.see(eye.field_of_view, eye.near, eye.far)
    this.camera.position.set(car.position.x, car.position.y, height)
    this.look(0, 0.5 * Math.PI)
  }

  private watch(eye: Record<string, any>, car: Placed, dt: number, halfLength: number): void {
    this.camera.position.fromArray(eye.position)
    const to = way.subVectors(car.position, this.camera.position)
    const level = Math.hypot(to.x, to.y)
    const before = this.god
    const pan = level > 1e-9 ? Math.atan2(to.y, to.x) : (before?.pan ?? 0) // straight below: any will do
    const tilt = Math.atan2(-to.z, level)
    const zoom = Math.min((eye.zoom * Math.atan2(halfLength, to.length())) / DEGREE, 170)
    const god = (this.god ??= { pan, tilt, zoom })
    const turned = -Math.expm1(-dt / eye.turn_time)
    const turn = pan - god.pan
    god.pan += turned * (turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI)))
    god.tilt += turned * (tilt - god.tilt)
    god.zoom -= Math.expm1(-dt / eye.zoom_time) * (zoom - god.zoom)
    this.see(god.zoom, eye.near, eye.far)
    this.look(god.pan, god.tilt)
  }

  private follow(car: Placed): void {
    const target = way.set(ORBIT_AHEAD, 0, ORBIT_ABOVE).applyQuaternion(car.orientation).add(car.position)
    if (this.isOrbiting) {
      this.orbit.position.add(target).sub(this.controls.target)
    } else {
      const heading = euler.setFromQuaternion(car.orientation, 'ZYX').z + Math.PI - ORBIT.aside
      const level = ORBIT.distance * Math.cos(ORBIT.elevation)
      const above = ORBIT.distance * Math.sin(ORBIT.elevation)
      this.orbit.position.set(level * Math.cos(heading), level * Math.sin(heading), above).add(target)
      this.isOrbiting = true
    }
    this.controls.target.copy(target)
    this.controls.update()
    this.see(this.orbit.fov, this.orbit.near, this.orbit.far)
    this.camera.position.copy(this.orbit.position)
    this.camera.quaternion.copy(this.orbit.quaternion)
  }

  dispose(): void {
    this.controls.dispose()
  }
}

/** The Bird's Eye's height [m] after so many clicks of the mouse wheel, up positive, within the limits. */
export function birdHeight(scene: Scene, height: number, clicks: number): number {
  const eye = scene.scene_cameras["Bird's Eye"]
  const next = Math.round((height + eye.step * clicks) * 1e6) / 1e6
  return Math.min(Math.max(next, eye.lowest), eye.highest)
}

const euler = new Euler()
const way = new Vector3()
