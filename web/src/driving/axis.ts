// An input axis for keys: ramps up while a key is pressed and back to zero when it is released.

/** Rates of the ramp up and of the return to zero [1/s]. Smaller values than DEAD become 0. */
const RAMP = 3
const RETURN = 3
const DEAD = 0.001

export class Axis {
  value = 0

  /** Advances by `dt` [s] towards `input` (-1, 0 or 1). When the direction changes, the value restarts at 0. */
  advance(input: number, dt: number): void {
    if (input === 0) {
      const size = Math.abs(this.value) - RETURN * dt
      this.value = size < DEAD ? 0 : Math.sign(this.value) * size
    } else {
      const start = this.value * input < 0 ? 0 : this.value
      this.value = Math.max(-1, Math.min(1, start + input * RAMP * dt))
    }
  }
}
