// Says that a connected devkit script does not drive, because the vehicle is in manual mode; a button switches.
import type { Actions } from '../actions'
import type { Store } from '../store'
import { h, setText } from './element'

export function modeHint(store: Store, actions: Actions): HTMLElement {
  const text = h('span')
  const element = h(
    'div',
    { class: 'hint mode-hint', testid: 'mode-hint', role: 'status', hidden: true },
    text,
    h(
      'button',
      { class: 'primary', testid: 'mode-hint-switch', onclick: () => actions.toggleMode() },
      'Switch to Autonomous',
    ),
    h('button', { testid: 'mode-hint-close', onclick: () => close() }, 'Stay in Manual'),
  )
  let isClosed = false

  function close(): void {
    isClosed = true
    show()
  }

  function show(): void {
    const isConnected = store.status.value?.bridge.state === 'connected'
    if (!isConnected) isClosed = false
    const name = store.vehicle.value
    const vehicle = store.frame.value?.vehicles[name]
    element.hidden = !isConnected || isClosed || vehicle === undefined || vehicle.is_autonomous
    setText(text, `A script is connected. ${name} does not obey it, because its driving mode is Manual.`)
  }

  store.status.watch(show)
  store.frame.watch(show)
  store.vehicle.watch(show)
  return element
}
