// Smooth motion out of Frames that come when they come: the world is shown a little late, between two of them.
import { Quaternion, Vector3 } from 'three'

import type { Frame, Pose, VehicleFrame } from '../messages'

/** How late, in intervals between Frames; with what comes unevenly, as much later as that. */
const DELAY = 1.5
/** Frames that are kept [s of simulated time]: as long as a scan can be old. */
const KEPT = 0.8
/** What moves farther than this between two Frames, and than its speed explains, was put there [m]. */
const JUMP = 0.25
/** A clock that is fast or slow is put right within about this time [s]. */
const CATCH_UP = 0.3
/** Without a Frame for so long, time stood still [s]. */
const PAUSE = 0.3
const TURN = 2 * Math.PI

export interface Placed {
  position: Vector3
  orientation: Quaternion
}

export interface VehicleMotion extends Placed {
  steering: Float64Array
  spin: Float64Array
  compression: Float64Array
  /** Of the later of the two Frames. */
  frame: VehicleFrame
}

/** What is shown now. */
export interface Moment {
  time: number
  isDay: boolean
  vehicles: Map<string, VehicleMotion>
  objects: Map<string, Placed>
}

interface Arrival {
  frame: Frame
  /** Wall time [s]. */
  at: number
}

export class Motion {
  readonly moment: Moment = { time: 0, isDay: true, vehicles: new Map(), objects: new Map() }
  private arrivals: Arrival[] = []
  private shown = 0
  private rate = 1
  private before = 0

  /** Forgets everything: another scenario. */
  clear(): void {
    this.arrivals = []
    this.moment.vehicles.clear()
    this.moment.objects.clear()
  }

  get isEmpty(): boolean {
    return this.arrivals.length === 0
  }

  /** Takes a Frame that has just come; `now` [s]. */
  take(frame: Frame, now: number): void {
    const latest = this.arrivals.at(-1)
    if (latest && frame.time < latest.frame.time) this.arrivals = []
    else if (latest && frame.time === latest.frame.time) this.arrivals.pop()
    if (this.arrivals.length === 0) this.shown = frame.time
    this.arrivals.push({ frame, at: now })
    while (this.arrivals.length > 2 && this.arrivals[1].frame.time < frame.time - KEPT) this.arrivals.shift()
  }

  /** Moves on to the wall time `now` [s]. */
  advance(now: number): Moment {
    const elapsed = Math.min(now - this.before, 0.25)
    this.before = now
    const latest = this.arrivals.at(-1)
    if (!latest) return this.moment
    const { rate, interval, jitter } = this.pace()
    const wanted = latest.frame.time + (now - latest.at) * rate - DELAY * interval - jitter
    const next = this.shown + elapsed * rate
    const ahead = wanted - next
    const tolerance = 4 * interval + 0.1 * rate
    // small differences are made up by a slightly faster or slower clock
    if (Math.abs(ahead) > tolerance) this.shown = Math.max(wanted, this.arrivals[0].frame.time)
    else this.shown = Math.max(this.shown, next - ahead * Math.expm1(-elapsed / CATCH_UP))
    this.shown = Math.min(this.shown, latest.frame.time)
    this.between()
    return this.moment
  }

  /** Where a vehicle was at that simulated time [s], as far back as is kept; null: not known. */
  poseAt(vehicle: string, time: number, into: Placed): Placed | null {
    const i = Math.max(1, this.after(time))
    const b = this.arrivals[Math.min(i, this.arrivals.length - 1)]?.frame
    const a = this.arrivals[i - 1]?.frame ?? b
    const [from, to] = [a?.vehicles[vehicle], b?.vehicles[vehicle]]
    if (!from || !to) return null
    place(into, from.pose, to.pose, fraction(a.time, b.time, time))
    return into
  }

  /** Simulated seconds per wall second, seconds of simulated time between Frames, and how unevenly they come. */
  private pace(): { rate: number; interval: number; jitter: number } {
    let first = Math.max(0, this.arrivals.length - 16)
    // a pause says nothing about the pace
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

  /** Index of the first Frame that is later than that time. */
  private after(time: number): number {
    let i = this.arrivals.length
    while (i > 0 && this.arrivals[i - 1].frame.time > time) i--
    return i
  }

  private between(): void {
    const i = this.after(this.shown)
    const a = this.arrivals[Math.max(i - 1, 0)].frame
    const b = this.arrivals[Math.min(i, this.arrivals.length - 1)].frame
    const f = fraction(a.time, b.time, this.shown)
    const dt = b.time - a.time
    const { moment } = this
    moment.time = this.shown
    moment.isDay = b.scene_light
    for (const [name, to] of Object.entries(b.vehicles)) {
      const from = a.vehicles[name] ?? to
      const way = distance(from.pose, to.pose)
      const isJump = way > JUMP && way > 3 * dt * (1 + Math.hypot(...to.velocity) + Math.hypot(...from.velocity))
      const g = isJump ? 1 : f
      let motion = moment.vehicles.get(name)
      if (!motion) moment.vehicles.set(name, (motion = still(to)))
      motion.frame = to
      place(motion, from.pose, to.pose, g)
      for (let w = 0; w < 4; w++) {
        const [p, q] = [from.wheels, to.wheels]
        motion.steering[w] = mix(p.steering_angle[w], q.steering_angle[w], g)
        motion.compression[w] = mix(p.compression[w], q.compression[w], g)
        const turned = 0.5 * (p.angular_velocity[w] + q.angular_velocity[w]) * dt
        motion.spin[w] = p.rotation_angle[w] + g * near(q.rotation_angle[w] - p.rotation_angle[w], turned)
      }
    }
    for (const [name, { pose }] of Object.entries(b.objects)) {
      const from = a.objects[name]?.pose ?? pose
      let placed = moment.objects.get(name)
      if (!placed) moment.objects.set(name, (placed = { position: new Vector3(), orientation: new Quaternion() }))
      place(placed, from, pose, distance(from, pose) > JUMP ? 1 : f)
    }
  }
}

function still(frame: VehicleFrame): VehicleMotion {
  const [steering, spin, compression] = [new Float64Array(4), new Float64Array(4), new Float64Array(4)]
  return { position: new Vector3(), orientation: new Quaternion(), steering, spin, compression, frame }
}

function fraction(a: number, b: number, time: number): number {
  return b > a ? Math.min(Math.max((time - a) / (b - a), 0), 1) : 1
}

function mix(a: number, b: number, f: number): number {
  return a + f * (b - a)
}

/** The angle that is equal to `difference` but for whole turns, and nearest to `expected`. */
function near(difference: number, expected: number): number {
  return difference + TURN * Math.round((expected - difference) / TURN)
}

function distance(a: Pose, b: Pose): number {
  const [p, q] = [a.position, b.position]
  return Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2])
}

const later = new Quaternion()

function place(into: Placed, a: Pose, b: Pose, f: number): void {
  const [p, q] = [a.position, b.position]
  into.position.set(mix(p[0], q[0], f), mix(p[1], q[1], f), mix(p[2], q[2], f))
  quaternion(a, into.orientation).slerp(quaternion(b, later), f)
}

/** Of a pose: ours are wxyz. */
export function quaternion({ orientation: [w, x, y, z] }: Pose, into: Quaternion): Quaternion {
  return into.set(x, y, z, w)
}
