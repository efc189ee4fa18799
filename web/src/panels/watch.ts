// Says how to take the wheel while the driver of the simulator drives, and gives the vehicle to the user who does.
import type { Actions } from '../actions'
import { actionOf } from '../driving/keys'
import { FIELDS } from '../fields'
import type { Store } from '../store'
import { h } from './element'

const DRIVING = ['forward', 'reverse', 'left', 'right']

export function watchHint(store: Store, actions: Actions): HTMLElement {
  const element = h(
    'p',
    { class: 'plate watch', testid: 'watch', role: 'status', hidden: true },
    h('span', { class: 'keyboard' }, 'Press ', h('kbd', {}, '{KeyW}'), ' to take the wheel'),
    h('span', { class: 'touch-only' }, 'Touch a pad to take the wheel'),
  )
  let hasBegun = false
  let isTaking = false

  async function take(): Promise<void> {
    const vehicle = store.watched.value
    if (!vehicle || isTaking) return
    isTaking = true
    if (await actions.request({ type: 'LetDrive', vehicle, is_on: false })) store.watched.value = ''
    isTaking = false
  }

  store.watched.watch((vehicle) => {
    hasBegun = false
    element.hidden = !vehicle
  })
  store.frame.watch((frame) => {
    const vehicle = frame?.vehicles[store.watched.value]
    if (!store.watched.value) return
    if (vehicle?.is_autonomous) hasBegun = true
    else if (hasBegun) store.watched.value = '' // a reset, another driving mode or another scenario has ended it
  })
  window.addEventListener(
    'keydown',
    (event) => {
      const isField = event.target instanceof Element && event.target.closest(FIELDS)
      const isDriving = !isField && !store.isFlying && !store.isMapViewed
      if (isDriving && DRIVING.includes(actionOf(event) ?? '')) void take()
    },
    { capture: true },
  )
  window.addEventListener('pointerdown', (event) => {
    if (event.target instanceof Element && event.target.closest('.pad')) void take()
  })
  return element
}
