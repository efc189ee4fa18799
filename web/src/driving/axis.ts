// A direction that keys push: it ramps up while they are pressed and back to zero when they are let go.

/** From 0 to 1 and back [1/s]; below DEAD it is 0. */
const SENSITIVITY = 3
const GRAVITY = 3
const DEAD = 0.001

export class Axis {
  value = 0

  /** Moves for `dt` [s] towards `push` (-1, 0 or 1). The other direction begins at 0, not where this one ended. */
  advance(push: number, dt: number): void {
    if (push === 0) {
      const size = Math.abs(this.value) - GRAVITY * dt
      this.value = size < DEAD ? 0 : Math.sign(this.value) * size
    } else {
      const start = this.value * push < 0 ? 0 : this.value
      this.value = Math.max(-1, Math.min(1, start + push * SENSITIVITY * dt))
    }
  }
}
