// Offers a Reset when a vehicle does not move any more after a collision, although somebody drives it.
import type { Actions } from '../actions'
import type { Store } from '../store'
import { h, setText } from './element'
import { busy } from './pending'

/** Simulated time without motion after which the hint is shown [s]. */
const STUCK_TIME = 3
/** A vehicle that is slower does not move [m/s]; one that is faster again drives on. */
const SLOW = 0.02
const FAST = 0.1

export function crashHint(store: Store, actions: Actions): HTMLElement {
  const text = h('span')
  const reset = h(
    'button',
    { class: 'primary', testid: 'crash-reset', onclick: () => void busy(reset, () => actions.reset()) },
    'Reset',
  )
  const close = h('button', { testid: 'crash-close', onclick: () => forget() }, 'Close')
  const buttons = h('div', { class: 'row' }, reset, close)
  const element = h('div', { class: 'hint', testid: 'crash-hint', role: 'status', hidden: true }, text, buttons)
  let hasCrashed = false
  /** Simulated time since which the vehicle stands [s]. */
  let since = 0
  let isDriven = false
  let time = 0

  function forget(): void {
    hasCrashed = isDriven = false
    element.hidden = true
  }

  store.events.watch((events) => {
    for (const event of events)
      if (event.type === 'Collision' && event.vehicle === store.vehicle.value) {
        hasCrashed = true
        isDriven = false
        since = event.time
      }
  })
  store.frame.watch((frame) => {
    const vehicle = frame?.vehicles[store.vehicle.value]
    if (!frame || !vehicle) return
    const { scene, refused } = store
    if (frame.time < time || scene.value?.timeline || 'Reset' in refused.value) forget()
    time = frame.time
    if (!hasCrashed) return
    const speed = Math.hypot(...vehicle.velocity)
    if (speed > FAST && !element.hidden) return forget()
    if (speed > SLOW) {
      since = time
      isDriven = false
    } else if (Math.abs(vehicle.throttle) > 0.01) isDriven = true
    if (!isDriven || time - since < STUCK_TIME || !element.hidden) return
    setText(text, `${store.vehicle.value} does not move after the crash. Reset sets it back to its start.`)
    element.hidden = false
  })
  store.vehicle.watch(forget)
  store.scene.watch(forget)
  return element
}
