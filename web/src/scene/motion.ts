// Motion interpolation: shows the world with a small delay, interpolated between two Frames.
import { Quaternion, Vector3 } from 'three'

import type { Frame, Pose, TrafficLightFrame, VehicleFrame, Weather } from '../messages'

/** The delay, in intervals between Frames; the jitter of the arrivals is added. */
const DELAY = 1.5
/** How long Frames are kept [s, simulated]: at least the age of the oldest scan that is shown. */
const HISTORY = 0.8
/** A movement between two Frames that is longer than this [m], and not explained by the speed, is a teleport. */
const MAX_MOVE = 0.25
/** Time constant of the correction of the clock [s]. */
const CLOCK_CORRECTION = 0.3
/** A longer simulated time between two Frames [s] is a jump in a recording. */
const JUMP = 2
/** A longer gap between two Frames [s] is a pause of the simulation. */
const PAUSE = 0.3
const TURN = 2 * Math.PI

export interface PlacedObject {
  position: Vector3
  orientation: Quaternion
}

export interface VehicleMotion extends PlacedObject {
  steering: Float64Array
  spin: Float64Array
  compression: Float64Array
  /** The vehicle in the later of the two Frames. */
  frame: VehicleFrame
}

/** The interpolated state that is shown. */
export interface WorldState {
  time: number
  isDay: boolean
  /** Since midnight [s]; null if the light is fixed. */
  timeOfDay: number | null
  /** null: clear. */
  weather: Weather | null
  /** Sight through the air [m]. */
  sight: number
  vehicles: Map<string, VehicleMotion>
  objects: Map<string, PlacedObject>
  trafficLights: Record<string, TrafficLightFrame>
}

interface Arrival {
  frame: Frame
  /** Wall time [s]. */
  at: number
}

export class MotionInterpolator {
  readonly state: WorldState = {
    ...{ time: 0, isDay: true, timeOfDay: null, weather: null, sight: Infinity },
    ...{ vehicles: new Map(), objects: new Map(), trafficLights: {} },
  }
  private arrivals: Arrival[] = []
  private shown = 0
  private rate = 1
  private before = 0

  /** Removes all Frames, before another scenario. */
  clear(): void {
    this.arrivals = []
    this.state.vehicles.clear()
    this.state.objects.clear()
  }

  get isEmpty(): boolean {
    return this.arrivals.length === 0
  }

  /** Adds a Frame that arrived at the wall time `now` [s]. */
  add(frame: Frame, now: number): void {
    const latest = this.arrivals.at(-1)
    if (latest && (frame.time < latest.frame.time || frame.time > latest.frame.time + JUMP)) this.arrivals = []
    else if (latest && frame.time === latest.frame.time) this.arrivals.pop()
    if (this.arrivals.length === 0) this.shown = frame.time
    this.arrivals.push({ frame, at: now })
    while (this.arrivals.length > 2 && this.arrivals[1].frame.time < frame.time - HISTORY) this.arrivals.shift()
  }

  /** The state at the wall time `now` [s]. */
  advance(now: number): WorldState {
    const elapsed = Math.min(now - this.before, 0.25)
    this.before = now
    const latest = this.arrivals.at(-1)
    if (!latest) return this.state
    const { rate, interval, jitter } = this.pace()
    const wanted = latest.frame.time + (now - latest.at) * rate - DELAY * interval - jitter
    const next = this.shown + elapsed * rate
    const ahead = wanted - next
    const tolerance = 4 * interval + 0.1 * rate
    // small differences are corrected by a slightly faster or slower clock
    if (Math.abs(ahead) > tolerance) this.shown = Math.max(wanted, this.arrivals[0].frame.time)
    else this.shown = Math.max(this.shown, next - ahead * Math.expm1(-elapsed / CLOCK_CORRECTION))
    this.shown = Math.min(this.shown, latest.frame.time)
    this.interpolate()
    return this.state
  }

  /** The state at a simulated time [s], or at the nearest one within the history. */
  at(time: number): WorldState {
    const [first, last] = [this.arrivals[0], this.arrivals[this.arrivals.length - 1]]
    if (!first) return this.state
    this.shown = Math.min(Math.max(time, first.frame.time), last.frame.time)
    this.interpolate()
    return this.state
  }

  /** Pose of a vehicle at a simulated time [s] within the history; null if the vehicle is unknown. */
  poseAt(vehicle: string, time: number, into: PlacedObject): PlacedObject | null {
    const i = Math.max(1, this.after(time))
    const b = this.arrivals[Math.min(i, this.arrivals.length - 1)]?.frame
    const a = this.arrivals[i - 1]?.frame ?? b
    const [from, to] = [a?.vehicles[vehicle], b?.vehicles[vehicle]]
    if (!from || !to) return null
    interpolatePose(into, from.pose, to.pose, fraction(a.time, b.time, time))
    return into
  }

  /** Simulated seconds per wall second, interval between Frames and jitter of their arrival [s, simulated]. */
  private pace(): { rate: number; interval: number; jitter: number } {
    let first = Math.max(0, this.arrivals.length - 16)
    // Frames before a pause do not count
    for (let i = first + 1; i < this.arrivals.length; i++) {
      if (this.arrivals[i].at - this.arrivals[i - 1].at > PAUSE) first = i
    }
    const recent = this.arrivals.slice(first)
    const n = recent.length - 1
    if (n < 1) return { rate: this.rate, interval: 0, jitter: 0 }
    const span = recent[n].frame.time - recent[0].frame.time
    const wall = recent[n].at - recent[0].at
    const rate = wall > 0.05 && n > 3 ? Math.min(span / wall, 50) : this.rate
    this.rate = rate
    let late = 0
    for (const { frame, at } of recent) {
      late = Math.max(late, at - recent[0].at - (frame.time - recent[0].frame.time) / Math.max(rate, 1e-3))
    }
    return { rate, interval: span / n, jitter: Math.min(late * rate, 0.1) * 0.5 }
  }

  /** Index of the first Frame after a simulated time. */
  private after(time: number): number {
    let i = this.arrivals.length
    while (i > 0 && this.arrivals[i - 1].frame.time > time) i--
    return i
  }

  private interpolate(): void {
    const i = this.after(this.shown)
    const a = this.arrivals[Math.max(i - 1, 0)].frame
    const b = this.arrivals[Math.min(i, this.arrivals.length - 1)].frame
    const f = fraction(a.time, b.time, this.shown)
    const dt = b.time - a.time
    const { state } = this
    state.time = this.shown
    state.isDay = b.scene_light
    state.trafficLights = b.traffic_lights
    state.timeOfDay = b.time_of_day
    state.weather = b.weather ?? null
    state.sight = b.weather_effects?.sight ?? Infinity
    for (const [name, to] of Object.entries(b.vehicles)) {
      const from = a.vehicles[name] ?? to
      const way = distance(from.pose, to.pose)
      const isTeleport =
        way > MAX_MOVE && way > 3 * dt * (1 + Math.hypot(...to.velocity) + Math.hypot(...from.velocity))
      const g = isTeleport ? 1 : f
      const motion = state.vehicles.get(name) ?? emptyMotion(to)
      state.vehicles.set(name, motion)
      motion.frame = to
      interpolatePose(motion, from.pose, to.pose, g)
      for (let w = 0; w < 4; w++) {
        const [p, q] = [from.wheels, to.wheels]
        motion.steering[w] = mix(p.steering_angle[w], q.steering_angle[w], g)
        motion.compression[w] = mix(p.compression[w], q.compression[w], g)
        const turned = 0.5 * (p.angular_velocity[w] + q.angular_velocity[w]) * dt
        motion.spin[w] = p.rotation_angle[w] + g * nearestTurn(q.rotation_angle[w] - p.rotation_angle[w], turned)
      }
    }
    for (const [name, { pose }] of Object.entries(b.objects)) {
      const from = a.objects[name]?.pose ?? pose
      const placed = state.objects.get(name) ?? { position: new Vector3(), orientation: new Quaternion() }
      state.objects.set(name, placed)
      interpolatePose(placed, from, pose, distance(from, pose) > MAX_MOVE ? 1 : f)
    }
  }
}

function emptyMotion(frame: VehicleFrame): VehicleMotion {
  const [steering, spin, compression] = [new Float64Array(4), new Float64Array(4), new Float64Array(4)]
  return { position: new Vector3(), orientation: new Quaternion(), steering, spin, compression, frame }
}

function fraction(a: number, b: number, time: number): number {
  return b > a ? Math.min(Math.max((time - a) / (b - a), 0), 1) : 1
}

function mix(a: number, b: number, f: number): number {
  return a + f * (b - a)
}

/** `difference` plus the number of whole turns that brings it nearest to `expected`. */
function nearestTurn(difference: number, expected: number): number {
  return difference + TURN * Math.round((expected - difference) / TURN)
}

function distance(a: Pose, b: Pose): number {
  const [p, q] = [a.position, b.position]
  return Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2])
}

const second = new Quaternion()

function interpolatePose(into: PlacedObject, a: Pose, b: Pose, f: number): void {
  const [p, q] = [a.position, b.position]
  into.position.set(mix(p[0], q[0], f), mix(p[1], q[1], f), mix(p[2], q[2], f))
  quaternion(a, into.orientation).slerp(quaternion(b, second), f)
}

/** Converts the orientation of a pose (wxyz) to a three.js quaternion. */
export function quaternion({ orientation: [w, x, y, z] }: Pose, into: Quaternion): Quaternion {
  return into.set(x, y, z, w)
}
