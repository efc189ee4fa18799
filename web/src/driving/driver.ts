// The state of keyboard, gamepad and touch input; the worker makes commands of it, so that drawing does not delay them.
import type { Connection } from '../connection'
import type { Headlights, Indicators } from '../messages'
import type { Store } from '../store'
import type { DriveInput } from '../worker/port'

/** Period at which inputs that are not at rest are passed on again, as a sign that the page runs [ms]. */
const SIGN_OF_LIFE = 200

export class Driver {
  /** Keys are -1, 0 or 1 and are ramped; gamepad and touch values are used directly. Call `change` after a change. */
  readonly keys: DriveInput = { throttle: 0, steering: 0 }
  readonly pad: DriveInput = { throttle: 0, steering: 0 }
  readonly touch: DriveInput = { throttle: 0, steering: 0 }
  private timer = 0

  constructor(
    store: Store,
    private readonly connection: Connection,
  ) {
    const release = () => {
      this.clear()
      connection.post({ type: 'Select', vehicle: store.vehicle.value })
    }
    store.vehicle.watch(release)
    window.addEventListener('pagehide', release)
  }

  /** Passes the inputs on. */
  change(): void {
    const { keys, pad, touch } = this
    const direct = { throttle: pad.throttle + touch.throttle, steering: pad.steering + touch.steering }
    this.connection.post({ type: 'Inputs', keys, direct })
    window.clearTimeout(this.timer)
    const isAtRest = [keys, pad, touch].every(({ throttle, steering }) => throttle === 0 && steering === 0)
    if (!isAtRest) this.timer = window.setTimeout(() => this.change(), SIGN_OF_LIFE)
  }

  toggleHeadlights(headlights: Headlights): void {
    this.connection.post({ type: 'Toggle', headlights })
  }

  toggleIndicators(indicators: Indicators): void {
    this.connection.post({ type: 'Toggle', indicators })
  }

  /** Sets all inputs to zero without a ramp, so that the vehicle brakes immediately. */
  stop(): void {
    this.clear()
    this.connection.post({ type: 'Stop' })
  }

  private clear(): void {
    window.clearTimeout(this.timer)
    for (const input of [this.keys, this.pad, this.touch]) input.throttle = input.steering = 0
  }
}
