// Requests remote rendering while the quality is 'stream'; falls back to 'low' if the simulator cannot render.
import type { Connection } from './connection'
import { clamp } from './scene/clamp'
import { lensZoomOf, ORBIT_ELEVATION } from './scene/zoom'
import type { Fly, Store } from './store'

/** Maximum width [pixels] and rate [Hz] of the images. */
const MAX_WIDTH = 1920
const RATE = 30
/** Width of the images relative to the window, in steps: a lower one if the rate [Hz] is lower than this. */
const STEPS = [1, 0.75, 0.5]
const LEAST_RATE = 12
/** Images are counted for so long [s]; a higher step is taken if its rate will probably be sufficient, by a margin. */
const COUNTED = 3
const MARGIN = 1.3

/** Orbit camera: rotation per pixel of dragging [rad], and place until the user moves it. */
const TURN = 0.006
const ORBIT = { azimuth: Math.PI * 0.8, elevation: 0.5, distance: 1 }

function flownTo({ x, y, z, azimuth, elevation }: Fly) {
  return { position: [x, y, z] as [number, number, number], azimuth, elevation }
}

/** Keeps the simulator informed of the camera to render while the quality is 'stream'. */
export function requestRemoteView(store: Store, connection: Connection, canvas: HTMLElement): void {
  let isStreaming = false
  let isScheduled = false
  let step = 0
  let count = 0
  let since = 0

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
    const isWanted = store.quality.value === 'stream' && !store.isStreamPaused.value
    if (store.link.value !== 'open' || !store.scene.value || (!isWanted && !isStreaming)) return
    isStreaming = isWanted
    const wide = STEPS[step] * canvas.clientWidth * Math.min(1, devicePixelRatio)
    const width = Math.min(MAX_WIDTH, Math.round(wide) || MAX_WIDTH)
    const camera = isWanted ? store.camera.value : null
    const { value: fly } = store.fly
    const free = camera === 'Fly' && fly ? flownTo(fly) : (store.orbit.value ?? ORBIT)
    const place = { height: store.birdHeight.value, ...free, zoom: lensZoomOf(store) }
    const overlays = {
      ...{ drawings: store.areDrawingsShown.value, shapes: store.areShapesShown.value, axes: store.areAxesShown.value },
      force_scale: store.areForcesShown.value ? store.forceScale.value : 0,
    }
    const view = { vehicle: store.vehicle.value, ...place, ...overlays, width, rate: RATE }
    connection.request({ type: 'SetCamera', camera, ...(isWanted && view) }).catch((error: Error) => {
      store.warning.value = error.message
      if (store.link.value !== 'open' || store.quality.value !== 'stream') return
      store.fallbackQuality = 'low'
      store.quality.value = 'low'
    })
  }

  /** Counts an image, and takes another step if there are too few or enough of them. */
  function judge(): void {
    const elapsed = performance.now() / 1000 - since
    if (elapsed > 2 * COUNTED) [count, since] = [0, performance.now() / 1000] // there were none for a while
    count++
    if (elapsed < COUNTED || elapsed > 2 * COUNTED) return
    const rate = count / elapsed
    ;[count, since] = [0, performance.now() / 1000]
    const higher = (rate * STEPS[step] ** 2) / (STEPS[step - 1] ?? Infinity) ** 2
    if (rate < LEAST_RATE && step < STEPS.length - 1) step++
    else if (higher > MARGIN * LEAST_RATE) step--
    else return
    schedule()
  }

  const { quality, camera, vehicle, birdHeight, lensZoom, orbit, fly, scene } = store
  const { areDrawingsShown, areShapesShown, areForcesShown, areAxesShown, forceScale } = store
  for (const observable of [quality, store.isStreamPaused, camera, vehicle, birdHeight, lensZoom, orbit, fly, scene])
    observable.watch(schedule)
  for (const observable of [areDrawingsShown, areShapesShown, areForcesShown, areAxesShown, forceScale])
    observable.watch(schedule)
  store.rendered.watch((image) => image && isStreaming && judge())
  window.addEventListener('resize', schedule)
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
    const turned = clamp(elevation + event.movementY * TURN, ORBIT_ELEVATION)
    store.orbit.value = { azimuth: azimuth - event.movementX * TURN, elevation: turned, distance }
  })
}
