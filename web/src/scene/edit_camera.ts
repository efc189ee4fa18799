// The camera of Edit mode: looks at the ground; the user moves it along the map, rotates it and zooms.
import { PerspectiveCamera, type Vector3 } from 'three'
import { MapControls } from 'three/addons/controls/MapControls.js'

import { STEP } from './zoom'

/** The first view: distances south of and above a vehicle [m]. */
const SOUTH = 1.3
const ABOVE = 1.9
const NEAREST = 0.3
const FARTHEST = 120
/** Share of the width of the window that an area gets: the rest is for panels. */
const SHARE = 0.5

export class EditCamera {
  private readonly camera = new PerspectiveCamera(50, 16 / 9, 0.02, 1000)
  private readonly controls: MapControls
  private isOpen = false

  constructor(canvas: HTMLElement) {
    this.camera.up.set(0, 0, 1)
    this.controls = new MapControls(this.camera, canvas)
    this.controls.enabled = false
    this.controls.minDistance = NEAREST
    this.controls.maxDistance = FARTHEST
    this.controls.maxPolarAngle = 0.47 * Math.PI
    this.controls.zoomToCursor = true
    this.controls.screenSpacePanning = false
  }

  /** Sets `camera`. When Edit mode starts, it looks at `around`, from `times` the usual distance. */
  update(camera: PerspectiveCamera, around: Vector3, times = 1): void {
    if (!this.isOpen) {
      this.controls.target.set(around.x, around.y, 0)
      this.camera.position.set(around.x, around.y - times * SOUTH, times * ABOVE)
    }
    this.isOpen = this.controls.enabled = true
    this.camera.aspect = camera.aspect
    this.camera.updateProjectionMatrix()
    this.controls.update()
    camera.fov = this.camera.fov
    camera.near = this.camera.near
    camera.far = this.camera.far
    camera.zoom = 1
    camera.position.copy(this.camera.position)
    camera.quaternion.copy(this.camera.quaternion)
    camera.updateProjectionMatrix()
    camera.updateMatrixWorld()
  }

  /** Looks at a point of the ground [m], from the same direction and distance. */
  moveTo(x: number, y: number): void {
    const { target } = this.controls
    this.camera.position.x += x - target.x
    this.camera.position.y += y - target.y
    target.x = x
    target.y = y
  }

  /** Looks at an area of the ground around a point, from the south; its width along x [m]. Also where the mode starts.
   *
   * `covered`: share of the window at the left that a panel covers.
   */
  showArea(x: number, y: number, width: number, covered: number): void {
    this.isOpen = true
    const slope = Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(this.camera.aspect, 16 / 9)
    const distance = Math.min(width / (2 * SHARE * slope), 0.95 * FARTHEST)
    const scale = distance / Math.hypot(SOUTH, ABOVE)
    x -= (Math.max(0, covered - 0.5 * (1 - SHARE)) * width) / SHARE
    this.controls.target.set(x, y, 0)
    this.camera.position.set(x, y - scale * SOUTH, scale * ABOVE)
  }

  /** Moves nearer to what it looks at by that number of clicks of the mouse wheel. */
  zoom(clicks: number): void {
    this.camera.position
      .sub(this.controls.target)
      .multiplyScalar(STEP ** -clicks)
      .add(this.controls.target)
  }

  /** Edit mode has ended. */
  close(): void {
    this.isOpen = this.controls.enabled = false
  }

  dispose(): void {
    this.controls.dispose()
  }
}
