// The fly camera: its place in the map, and how keys, pads and dragging move it.
import type { Fly, FlyInput, Store } from '../store'
import { clamp } from './clamp'

/** Speed [m/s] and rate of turning [rad/s] of a held key; with Shift they are multiplied. */
const SPEED = 1.5
const TURN_RATE = 1.2
const FAST = 4
/** Rotation per pixel of dragging [rad], and way of a click of the mouse wheel [m]. */
const TURN = 0.004
const CLICK = 0.2
/** Limits of the place [m], as those of the simulator, and of the elevation [rad]. */
const EXTENT = [-1000, 1000] as const
const HEIGHT = [0.02, 200] as const
const ELEVATION = [-1.55, 1.55] as const

/** The camera after `dt` [s] with that input; the same object if nothing moves it. */
export function flown(fly: Fly, input: FlyInput, dt: number): Fly {
  const { ahead, left, up, turn, tilt } = input
  if (![ahead, left, up, turn, tilt].some(Boolean)) return fly
  const times = dt * (input.isFast ? FAST : 1)
  // half of the turn before the way and half after it: the path is the same arc at any rate of images
  const half = 0.5 * times * TURN_RATE
  const way = moved(
    lookedAside(fly, half * turn, half * tilt),
    times * SPEED * ahead,
    times * SPEED * left,
    times * SPEED * up,
  )
  return lookedAside(way, half * turn, half * tilt)
}

/** Moves the camera along the direction in which it looks, nearer by that number of clicks of the mouse wheel. */
export function flownNearer(fly: Fly, clicks: number): Fly {
  return moved(fly, CLICK * clicks, 0, 0)
}

function moved(fly: Fly, ahead: number, left: number, up: number): Fly {
  const { azimuth, elevation } = fly
  const level = ahead * Math.cos(elevation)
  return within({
    ...fly,
    x: fly.x + level * Math.cos(azimuth) - left * Math.sin(azimuth),
    y: fly.y + level * Math.sin(azimuth) + left * Math.cos(azimuth),
    z: fly.z + ahead * Math.sin(elevation) + up,
  })
}

function lookedAside(fly: Fly, left: number, up: number): Fly {
  return within({ ...fly, azimuth: fly.azimuth + left, elevation: fly.elevation + up })
}

/** The nearest permitted place and direction. */
export function within({ x, y, z, azimuth, elevation }: Fly): Fly {
  const once = azimuth - 2 * Math.PI * Math.round(azimuth / (2 * Math.PI))
  return {
    ...{ x: clamp(x, EXTENT), y: clamp(y, EXTENT), z: clamp(z, HEIGHT) },
    ...{ azimuth: once, elevation: clamp(elevation, ELEVATION) },
  }
}

/** Dragging on the canvas turns the fly camera. */
export function listenToFlyPointer(store: Store, canvas: HTMLElement): void {
  canvas.addEventListener('pointermove', ({ buttons, movementX, movementY }) => {
    const fly = store.fly.value
    if (!store.isFlying || !fly || (buttons & 1) === 0) return
    store.fly.value = lookedAside(fly, -TURN * movementX, -TURN * movementY)
  })
}
