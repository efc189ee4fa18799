// The state of keyboard, gamepad and touch input; the worker makes commands of it, so that drawing does not delay them.
import type { Connection } from '../connection'
import type { Headlights, Indicators } from '../messages'
import type { Store } from '../store'
import type { DriveInput } from '../worker/port'

export class Driver {
  /** Keys are -1, 0 or 1 and are ramped; gamepad and touch values are used directly. Call `change` after a change. */
  readonly keys: DriveInput = { throttle: 0, steering: 0 }
  readonly pad: DriveInput = { throttle: 0, steering: 0 }
  readonly touch: DriveInput = { throttle: 0, steering: 0 }

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
    for (const input of [this.keys, this.pad, this.touch]) input.throttle = input.steering = 0
  }
}
