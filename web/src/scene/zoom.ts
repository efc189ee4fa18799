// The mouse wheel zooms every camera in the same direction: up is nearer.
import type { Scene } from '../messages'
import type { Store } from '../store'
import { clamp } from './clamp'
import { flownNearer } from './flight'

/** Change of the distance or of the focal length by a click of the mouse wheel. */
export const STEP = 1.1
/** A click of the mouse wheel in a wheel event [pixels]. */
const CLICK = 100
/** Limits of the focal length of Driver's Eye and God's Eye, relative to the standard one. */
export const LENS_ZOOM = [0.4, 10] as const
/** Limits of the distance of the orbit [m]. */
export const ORBIT_DISTANCE = [0.15, 12] as const
/** Limits of the elevation of the orbit [rad]. */
export const ORBIT_ELEVATION = [0.02, 1.5] as const

/** Number of clicks of the mouse wheel in an event; up is positive. A touch pad sends parts of a click. */
export function wheelClicks(event: WheelEvent): number {
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : CLICK / 3
  return (-event.deltaY * lines) / CLICK
}

/** Moves the selected camera nearer by that number of clicks; negative: farther. */
export function zoomCamera(store: Store, clicks: number): void {
  const { camera, scene, orbit, fly, lensZoom, birdHeight } = store
  const factor = STEP ** clicks
  if (camera.value === "Bird's Eye") {
    if (scene.value) birdHeight.value = heightAfter(scene.value, birdHeight.value, clicks)
  } else if (camera.value === 'Orbit') {
    if (orbit.value) orbit.value = { ...orbit.value, distance: clamp(orbit.value.distance / factor, ORBIT_DISTANCE) }
  } else if (camera.value === 'Fly') {
    if (fly.value) fly.value = flownNearer(fly.value, clicks)
  } else {
    const zoom = clamp(lensZoom.value[camera.value] * factor, LENS_ZOOM)
    lensZoom.value = { ...lensZoom.value, [camera.value]: zoom }
  }
}

/** Focal length of the selected camera, relative to the standard one. */
export function lensZoomOf({ camera: { value: camera }, lensZoom }: Store): number {
  return camera === "Driver's Eye" || camera === "God's Eye" ? lensZoom.value[camera] : 1
}

/** Height of the Bird's Eye [m] after `clicks` of the mouse wheel, within the limits. */
export function heightAfter(scene: Scene, height: number, clicks: number): number {
  const spec = scene.scene_cameras["Bird's Eye"]
  const next = Math.round((height - spec.step * clicks) * 1e6) / 1e6
  return clamp(next, [spec.lowest, spec.highest])
}
