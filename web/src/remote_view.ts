// Requests remote rendering while the quality is 'stream'; falls back to 'low' if the simulator cannot render.
import type { Connection } from './connection'
import { clamp, lensZoomOf } from './scene/zoom'
import type { Store } from './store'

/** Maximum width [pixels] and rate [Hz] of the images. */
const MAX_WIDTH = 960
const RATE = 30

/** Orbit camera: rotation per pixel of dragging [rad], limits of the elevation, and place until the user moves it. */
const TURN = 0.006
const ELEVATION = [0.02, 1.5] as const
const ORBIT = { azimuth: Math.PI * 0.8, elevation: 0.5, distance: 1 }

/** Keeps the simulator informed of the camera to render while the quality is 'stream'. */
export function requestRemoteView(store: Store, connection: Connection, canvas: HTMLElement): void {
  let isStreaming = false
  let isScheduled = false

  /** Sends one request per task, after all changes in it. */
  function schedule(): void {
    if (isScheduled) return
    isScheduled = true
    queueMicrotask(() => {
      isScheduled = false
      send()
    })
  }

  function send(): void {
    const isWanted = store.quality.value === 'stream'
    if (store.link.value !== 'open' || !store.scene.value || (!isWanted && !isStreaming)) return
    isStreaming = isWanted
    const width = Math.min(MAX_WIDTH, Math.round(canvas.clientWidth * Math.min(1, devicePixelRatio)) || MAX_WIDTH)
    const camera = isWanted ? store.camera.value : null
    const place = { height: store.birdHeight.value, ...(store.orbit.value ?? ORBIT), zoom: lensZoomOf(store) }
    const view = { vehicle: store.vehicle.value, ...place, width, rate: RATE }
    connection.request({ type: 'SetCamera', camera, ...(isWanted && view) }).catch((error: Error) => {
      store.warning.value = error.message
      if (store.link.value !== 'open' || store.quality.value !== 'stream') return
      store.fallbackQuality = 'low'
      store.quality.value = 'low'
    })
  }

  const { quality, camera, vehicle, birdHeight, lensZoom, orbit, scene } = store
  for (const observable of [quality, camera, vehicle, birdHeight, lensZoom, orbit, scene]) observable.watch(schedule)
  store.link.watch((link) => {
    if (link !== 'open')
      isStreaming = false // a new server has no camera for this page
    else schedule()
  })

  const isOrbiting = (): boolean => store.quality.value === 'stream' && store.camera.value === 'Orbit'
  store.camera.watch(() => {
    if (isOrbiting()) store.orbit.value ??= ORBIT
  })
  canvas.addEventListener('pointermove', (event) => {
    if (!isOrbiting() || (event.buttons & 1) === 0) return
    const { azimuth, elevation, distance } = store.orbit.value ?? ORBIT
    const turned = clamp(elevation + event.movementY * TURN, ELEVATION)
    store.orbit.value = { azimuth: azimuth - event.movementX * TURN, elevation: turned, distance }
  })
}
