// Makes Drive messages from the inputs of the user: one at each change, then at a constant rate until they are at rest.
import { Axis } from '../driving/axis'
import { LampCommands } from '../driving/lamp_commands'
import type { ClientMessage, Frame, Headlights, Indicators, VehicleFrame } from '../messages'
import type { DriveInput } from './port'

/** Period of the messages while an input is active [ms]. */
const PERIOD = 16
/** Duration of the first step of a ramp [s]; it is taken at the key press. */
const FIRST_STEP = 0.016
/** Upper limit of a step [s], so that a worker that was busy does not jump. */
const MAX_STEP = 0.1
/** The vehicle stops after this time without a sign of life of the page [ms], which gives one each 0.2 s. */
const MAX_SILENCE = 900

const REST: DriveInput = { throttle: 0, steering: 0 }

export class CommandSender {
  /** The latest Frame. */
  frame: Frame | null = null

  private keys = REST
  private direct = REST
  private readonly throttle = new Axis()
  private readonly steering = new Axis()
  private readonly lamps = new LampCommands()
  private vehicle = ''
  private timer: ReturnType<typeof setInterval> | undefined
  private last = 0
  private heard = 0
  private isMoving = false

  /** `onBlocked` is called with the vehicle if an input has no effect, because it is in autonomous mode. */
  constructor(
    private readonly post: (message: ClientMessage) => void,
    private readonly onBlocked: (vehicle: string) => void,
  ) {}

  /** The page runs. A page that hangs does not notice that a key was released. */
  onSignOfLife(): void {
    this.heard = performance.now()
  }

  /** Releases the vehicle that was driven, and drives another one from now on. */
  select(vehicle: string): void {
    const wasDriving = this.timer !== undefined
    this.stop()
    if (wasDriving) this.post({ type: 'Release', vehicle: this.vehicle })
    this.vehicle = vehicle
  }

  /** Sends a command in the same task, and starts the timer that sends more until all inputs are at rest. */
  change(keys: DriveInput, direct: DriveInput): void {
    this.keys = keys
    this.direct = direct
    this.start()
  }

  toggle({ headlights, indicators }: { headlights?: Headlights; indicators?: Indicators }): void {
    if (!this.vehicleFrame || this.isBlocked(true)) return
    const { lights } = this.vehicleFrame
    if (headlights !== undefined) this.lamps.toggleHeadlights(headlights, lights)
    if (indicators !== undefined) this.lamps.toggleIndicators(indicators, lights)
    this.start()
  }

  /** Sets all inputs to zero without a ramp, so that the vehicle brakes immediately. */
  stop(): void {
    this.keys = this.direct = REST
    this.throttle.value = this.steering.value = 0
    if (this.isMoving) this.send(0, 0)
    this.stopTimer()
  }

  /** There is no data of the simulator: nothing is sent until the next Frame. */
  lose(): void {
    this.stop()
    this.frame = null
  }

  private get vehicleFrame(): VehicleFrame | undefined {
    return this.frame?.vehicles[this.vehicle]
  }

  private start(): void {
    if (this.isBlocked()) return
    if (this.timer === undefined) {
      this.last = performance.now() - FIRST_STEP * 1000
      this.timer = setInterval(() => this.repeat(), PERIOD)
    }
    this.advance()
  }

  private repeat(): void {
    if (performance.now() - this.heard > MAX_SILENCE) this.stop()
    else this.advance()
  }

  private advance(): void {
    if (this.isBlocked()) return
    const now = performance.now()
    const dt = Math.min((now - this.last) / 1000, MAX_STEP)
    this.last = now
    this.throttle.advance(Math.sign(this.keys.throttle), dt)
    this.steering.advance(Math.sign(this.keys.steering), dt)
    const throttle = clamp(this.throttle.value + this.direct.throttle)
    const steering = clamp(this.steering.value + this.direct.steering)
    const isMoving = throttle !== 0 || steering !== 0
    if (isMoving || this.isMoving || this.lamps.isPending) this.send(throttle, steering)
    else this.stopTimer()
    this.isMoving = isMoving
  }

  private send(throttle: number, steering: number): void {
    const command = { throttle, steering, ...this.lamps.pending() }
    this.post({ type: 'Drive', vehicle: this.vehicle, command, source: 'person' })
  }

  private stopTimer(): void {
    clearInterval(this.timer)
    this.timer = undefined
    this.isMoving = false
  }

  /** Whether there is no vehicle, or it is in autonomous mode. */
  private isBlocked(isPressed = false): boolean {
    if (!this.vehicleFrame) return true
    if (!this.vehicleFrame.is_autonomous) return false
    if (isPressed || [this.keys, this.direct].some(({ throttle, steering }) => throttle !== 0 || steering !== 0))
      this.onBlocked(this.vehicle)
    this.throttle.value = this.steering.value = 0
    this.stopTimer()
    return true
  }
}

function clamp(value: number): number {
  return Math.max(-1, Math.min(1, value))
}
