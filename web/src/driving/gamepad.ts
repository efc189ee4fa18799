// Gamepad input in the standard mapping: the left stick steers, the triggers drive, buttons switch the lamps.
import { Headlights, Indicators } from '../messages'
import type { Store } from '../store'
import type { Driver } from './driver'

/** Dead zone of a stick. */
const DEAD = 0.08
/** Polling period [ms]; browsers send no events when a stick moves. */
const PERIOD = 16

/** Button index in the standard mapping -> its action. */
const BUTTONS: Record<number, (driver: Driver) => void> = {
  0: (driver) => driver.toggleHeadlights(Headlights.LOW), // A, cross
  1: (driver) => driver.toggleIndicators(Indicators.HAZARD), // B, circle
  3: (driver) => driver.toggleHeadlights(Headlights.HIGH), // Y, triangle
  4: (driver) => driver.toggleIndicators(Indicators.LEFT), // left shoulder
  5: (driver) => driver.toggleIndicators(Indicators.RIGHT), // right shoulder
}
const REVERSE_TRIGGER = 6
const THROTTLE_TRIGGER = 7

/** Polls the first connected gamepad with the standard mapping. Names each gamepad without that mapping once. */
export function listenToGamepad(driver: Driver, store: Store): void {
  let timer = 0
  let pressed = new Set<number>()
  /** Index of the gamepad that was read last. */
  let index = -1
  const named = new Set<string>()

  function poll(): void {
    const pad = navigator.getGamepads().find((each) => each?.mapping === 'standard')
    if (index !== (pad?.index ?? -1)) {
      if (index >= 0) driver.stop() // the gamepad that drove is gone
      index = pad?.index ?? -1
      pressed = new Set()
    }
    if (!pad || document.hidden || !document.hasFocus()) return
    const throttle = (pad.buttons[THROTTLE_TRIGGER]?.value ?? 0) - (pad.buttons[REVERSE_TRIGGER]?.value ?? 0)
    const steering = withoutDeadZone(-(pad.axes[0] ?? 0)) // the axis of the stick is positive to the right
    if (throttle !== driver.pad.throttle || steering !== driver.pad.steering) {
      Object.assign(driver.pad, { throttle, steering })
      driver.change()
    }
    const now = new Set(pad.buttons.flatMap((button, i) => (button.pressed ? [i] : [])))
    for (const i of now) if (!pressed.has(i)) BUTTONS[i]?.(driver)
    pressed = now
  }

  window.addEventListener('gamepadconnected', ({ gamepad: { id, mapping } }) => {
    if (timer === 0) timer = window.setInterval(poll, PERIOD)
    if (mapping === 'standard' || named.has(id)) return
    named.add(id)
    store.notice.value = `The gamepad '${id}' cannot drive: the browser does not know where its sticks and buttons are.`
  })
  window.addEventListener('gamepaddisconnected', () => {
    poll()
    if (navigator.getGamepads().some(Boolean)) return
    window.clearInterval(timer)
    timer = 0
  })
}

/** Rescales the value of a stick: 0 in the dead zone, then linear up to 1. */
function withoutDeadZone(value: number): number {
  const size = Math.max(0, Math.abs(value) - DEAD) / (1 - DEAD)
  return size === 0 ? 0 : Math.sign(value) * Math.min(1, size)
}
