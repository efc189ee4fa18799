// The person at the wheel: what keys, gamepad and touch want becomes Drive messages, at once and then steadily.
import type { Connection } from '../connection'
import type { Headlights, Indicators, VehicleFrame } from '../messages'
import type { Store } from '../store'
import { Axis } from './axis'
import { Lamps } from './lamps'

/** Between messages while something is pressed [ms]. A timer, since a page that is not seen is not drawn. */
const PERIOD = 16
/** The first step of a ramp, taken before any time has passed [s]. */
const FIRST = 0.016
/** A page that was busy does not jump [s]. */
const LONGEST = 0.1

/** What an input wants of a vehicle, each [-1, 1]: throttle forward, steering left positive. */
export interface Wish {
  throttle: number
  steering: number
}

export class Driver {
  /** Keys push (-1, 0, 1) and are ramped; sticks say what they want as it is. Call `change` after a change. */
  readonly keys: Wish = { throttle: 0, steering: 0 }
  readonly pad: Wish = { throttle: 0, steering: 0 }
  readonly touch: Wish = { throttle: 0, steering: 0 }

  private readonly throttle = new Axis()
  private readonly steering = new Axis()
  private readonly lamps = new Lamps()
  private vehicle = ''
  private timer = 0
  private last = 0
  private isMoving = false

  constructor(
    private readonly store: Store,
    private readonly connection: Connection,
  ) {
    store.vehicle.watch((vehicle) => this.changeOver(vehicle))
    window.addEventListener('pagehide', () => this.letGo())
  }

  /** An input changed: says so now, in the same task, and goes on until all is at rest again. */
  change(): void {
    if (this.isLockedOut()) return
    if (this.timer === 0) {
      this.last = performance.now() - FIRST * 1000
      this.timer = window.setInterval(() => this.advance(), PERIOD)
    }
    this.advance()
  }

  toggleHeadlights(beam: Headlights): void {
    const frame = this.frame
    if (!frame || this.isLockedOut(true)) return
    this.lamps.toggleHeadlights(beam, frame.lights)
    this.change()
  }

  toggleIndicators(side: Indicators): void {
    const frame = this.frame
    if (!frame || this.isLockedOut(true)) return
    this.lamps.toggleIndicators(side, frame.lights)
    this.change()
  }

  /** Everything is let go, without a ramp: the vehicle brakes now. */
  stop(): void {
    for (const wish of [this.keys, this.pad, this.touch]) wish.throttle = wish.steering = 0
    this.throttle.value = this.steering.value = 0
    if (this.isMoving) this.say(0, 0)
    this.rest()
  }

  private get frame(): VehicleFrame | undefined {
    return this.store.frame.value?.vehicles[this.store.vehicle.value]
  }

  private advance(): void {
    if (this.isLockedOut()) return
    const now = performance.now()
    const dt = Math.min((now - this.last) / 1000, LONGEST)
    this.last = now
    this.throttle.advance(Math.sign(this.keys.throttle), dt)
    this.steering.advance(Math.sign(this.keys.steering), dt)
    const throttle = limited(this.throttle.value + this.pad.throttle + this.touch.throttle)
    const steering = limited(this.steering.value + this.pad.steering + this.touch.steering)
    const isMoving = throttle !== 0 || steering !== 0
    if (isMoving || this.isMoving || this.lamps.isAsking) this.say(throttle, steering)
    else this.rest()
    this.isMoving = isMoving
  }

  private say(throttle: number, steering: number): void {
    const command = { throttle, steering, ...this.lamps.latest() }
    this.connection.send({ type: 'Drive', vehicle: this.vehicle, command, source: 'person' })
  }

  private rest(): void {
    window.clearInterval(this.timer)
    this.timer = 0
    this.isMoving = false
  }

  /** A vehicle in autonomous mode does not obey a person, who is told so once a press. */
  private isLockedOut(isPressed = false): boolean {
    if (!this.frame) return true
    if (!this.frame.is_autonomous) return false
    const wishes = [this.keys, this.pad, this.touch]
    if (isPressed || wishes.some((wish) => wish.throttle !== 0 || wish.steering !== 0)) {
      this.store.notice.value = `${this.vehicle} is in Autonomous mode. Press Driving Mode in the menu to drive.`
    }
    this.throttle.value = this.steering.value = 0
    this.rest()
    return true
  }

  private changeOver(vehicle: string): void {
    this.letGo()
    this.vehicle = vehicle
  }

  private letGo(): void {
    const wasDriving = this.timer !== 0
    this.stop()
    if (wasDriving) this.connection.send({ type: 'Release', vehicle: this.vehicle })
  }
}

function limited(value: number): number {
  return Math.max(-1, Math.min(1, value))
}
