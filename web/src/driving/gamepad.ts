// A gamepad of the standard mapping: left stick steers, triggers drive, buttons switch the lamps.
import { Headlights, Indicators } from '../messages'
import type { Driver } from './driver'

/** A stick at rest is not quite at 0. */
const DEAD = 0.08
/** Browsers tell no change of a stick: look this often [ms]. */
const PERIOD = 16

/** Standard mapping: button -> what a press does. */
const BUTTONS: Record<number, (driver: Driver) => void> = {
  0: (driver) => driver.toggleHeadlights(Headlights.LOW), // A, cross
  1: (driver) => driver.toggleIndicators(Indicators.HAZARD), // B, circle
  3: (driver) => driver.toggleHeadlights(Headlights.HIGH), // Y, triangle
  4: (driver) => driver.toggleIndicators(Indicators.LEFT), // left shoulder
  5: (driver) => driver.toggleIndicators(Indicators.RIGHT), // right shoulder
}
const REVERSE_TRIGGER = 6
const THROTTLE_TRIGGER = 7

/** Listens from now on, to the first gamepad that is plugged in. */
export function listenToGamepad(driver: Driver): void {
  let timer = 0
  let pressed = new Set<number>()

  function look(): void {
    const pad = navigator.getGamepads().find((each) => each?.mapping === 'standard')
    if (!pad || document.hidden || !document.hasFocus()) return
    const throttle = (pad.buttons[THROTTLE_TRIGGER]?.value ?? 0) - (pad.buttons[REVERSE_TRIGGER]?.value ?? 0)
    const steering = live(-(pad.axes[0] ?? 0)) // a stick to the left is negative
    if (throttle !== driver.pad.throttle || steering !== driver.pad.steering) {
      Object.assign(driver.pad, { throttle, steering })
      driver.change()
    }
    const now = new Set(pad.buttons.flatMap((button, i) => (button.pressed ? [i] : [])))
    for (const i of now) if (!pressed.has(i)) BUTTONS[i]?.(driver)
    pressed = now
  }

  window.addEventListener('gamepadconnected', () => {
    if (timer === 0) timer = window.setInterval(look, PERIOD)
  })
  window.addEventListener('gamepaddisconnected', () => {
    if (navigator.getGamepads().some(Boolean)) return
    window.clearInterval(timer)
    timer = 0
    driver.stop()
  })
}

/** Of a stick: 0 in its dead zone, from there on to 1. */
function live(value: number): number {
  const size = Math.max(0, Math.abs(value) - DEAD) / (1 - DEAD)
  return size === 0 ? 0 : Math.sign(value) * Math.min(1, size)
}
