// The quality 'stream': the simulator draws the chosen scene camera for this page, or the page does where it cannot.
import type { Connection } from './connection'
import type { Store } from './store'

/** Pictures no wider than this [pixels], and so many a second at most [Hz]. */
const WIDEST = 960
const RATE = 30

/** Orbit: how far a pixel of dragging turns [rad], a notch of the wheel zooms, and the limits. */
const TURN = 0.006
const ZOOM = 1.1
const ELEVATION = [0.02, 1.5] as const
const DISTANCE = [0.3, 12] as const

/** From now on, the simulator is told what to draw for as long as the quality is 'stream'. */
export function stream(store: Store, connection: Connection, canvas: HTMLElement): void {
  const orbit = { azimuth: Math.PI * 0.8, elevation: 0.5, distance: 1 }
  let isStreaming = false
  let isAsked = false

  /** Once a task, however much changed in it. */
  function ask(): void {
    if (isAsked) return
    isAsked = true
    queueMicrotask(() => {
      isAsked = false
      say()
    })
  }

  function say(): void {
    const wanted = store.quality.value === 'stream'
    if (store.link.value !== 'open' || !store.scene.value || (!wanted && !isStreaming)) return
    isStreaming = wanted
    const width = Math.min(WIDEST, Math.round(canvas.clientWidth * Math.min(1, devicePixelRatio)) || WIDEST)
    const view = { vehicle: store.vehicle.value, height: store.birdHeight.value, ...orbit, width, rate: RATE }
    const camera = wanted ? store.camera.value : null
    connection.request({ type: 'SetCamera', camera, ...(wanted && view) }).catch((fault: Error) => {
      store.notice.value = fault.message
      if (store.link.value === 'open' && store.quality.value === 'stream') store.quality.value = 'low'
    })
  }

  for (const signal of [store.quality, store.camera, store.vehicle, store.birdHeight, store.scene]) signal.watch(ask)
  store.link.watch((link) => {
    if (link !== 'open') isStreaming = false // whoever answers next knows nothing of it
    else ask()
  })

  const isTurning = (): boolean => store.quality.value === 'stream' && store.camera.value === 'Orbit'
  canvas.addEventListener('pointermove', (event) => {
    if (!isTurning() || (event.buttons & 1) === 0) return
    orbit.azimuth -= event.movementX * TURN
    orbit.elevation = within(orbit.elevation + event.movementY * TURN, ELEVATION)
    ask()
  })
  canvas.addEventListener(
    'wheel',
    (event) => {
      if (!isTurning()) return
      event.preventDefault()
      orbit.distance = within(orbit.distance * (event.deltaY > 0 ? ZOOM : 1 / ZOOM), DISTANCE)
      ask()
    },
    { passive: false },
  )
}

function within(value: number, [low, high]: readonly [number, number]): number {
  return Math.max(low, Math.min(high, value))
}
