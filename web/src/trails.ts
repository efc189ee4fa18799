// The line that each vehicle has driven, from the Frames and the places between them; shown in the 3D view and on the small map.
import type { Frame, Ways } from './messages'

/** Distance between two points of a trail [m]. */
const SPACING = 0.02
/** A movement between two Frames that is longer than this [m], and not explained by the speed, is a jump. */
const JUMP = 0.25
/** After a longer simulated time without a Frame [s] each movement is a jump. */
const GAP = 2
/** Number of points of a trail; when it is full, the older half is dropped. */
export const TRAIL_POINTS = 4096

/** Points of one vehicle: x, y, z of the ground below its rear axle [m]. NaN before a jump. */
export interface Trail {
  readonly points: Float32Array
  length: number
  /** Number of times that points were dropped or the trail was cleared. */
  version: number
}

export class Trails {
  readonly all = new Map<string, Trail>()
  private time = 0
  /** The latest speed of each vehicle [m/s]. */
  private readonly speeds = new Map<string, number>()

  /** Adds the positions of a Frame; `radius` of the wheels by vehicle [m]. Time that goes back clears the trails. */
  add(frame: Frame, radius: (vehicle: string) => number): void {
    for (const [name, { velocity }] of Object.entries(frame.vehicles)) this.speeds.set(name, Math.hypot(...velocity))
    const places = Object.entries(frame.vehicles).map(([name, { pose }]) => [name, pose.position] as const)
    this.addPlaces(frame.time, places, radius)
  }

  /** Adds the places since the Frame before; their Frame follows. */
  addWays({ times, positions }: Ways, radius: (vehicle: string) => number): void {
    times.forEach((time, i) => {
      if (time <= this.time) return // of a Frame that is known
      const places = Object.entries(positions).map(([name, all]) => [name, all.subarray(3 * i, 3 * i + 3)] as const)
      this.addPlaces(time, places, radius)
    })
  }

  private addPlaces(
    time: number,
    places: readonly (readonly [string, Float64Array])[],
    radius: (vehicle: string) => number,
  ): void {
    if (time < this.time) this.clear()
    const elapsed = time - this.time
    this.time = time
    for (const [name, [x, y, z]] of places) {
      const trail = this.all.get(name) ?? { points: new Float32Array(3 * TRAIL_POINTS), length: 0, version: 0 }
      this.all.set(name, trail)
      const speed = this.speeds.get(name) ?? 0
      const reach = elapsed > GAP ? JUMP : Math.max(JUMP, 3 * elapsed * (1 + speed))
      extend(trail, [x, y, z - radius(name)], reach)
    }
  }

  clear(): void {
    for (const trail of this.all.values()) {
      trail.length = 0
      trail.version += 1
    }
  }

  /** Removes the vehicles, before another scenario. */
  reset(): void {
    this.all.clear()
    this.time = 0
  }
}

/** Adds a point if it is far enough from the last one; `reach` [m]: a longer way is a jump. */
function extend(trail: Trail, [x, y, z]: readonly [number, number, number], reach: number): void {
  const { points, length } = trail
  if (length > 0) {
    const way = Math.hypot(x - points[3 * length - 3], y - points[3 * length - 2])
    if (way < SPACING) return
    if (way > reach) push(trail, NaN, NaN, NaN)
  }
  push(trail, x, y, z)
}

function push(trail: Trail, x: number, y: number, z: number): void {
  if (trail.length === TRAIL_POINTS) {
    trail.points.copyWithin(0, (3 * TRAIL_POINTS) / 2)
    trail.length = TRAIL_POINTS / 2
    trail.version += 1
  }
  trail.points.set([x, y, z], 3 * trail.length++)
}
