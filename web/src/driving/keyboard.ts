// Keyboard input (report, table 12): held keys drive or move the fly camera, other keys run an action once.

import { FIELDS } from '../fields'
import type { Store } from '../store'
import type { Driver } from './driver'
import type { KeyAction } from './keys'
import { actionOf, codeOf, FLY_KEYS, keyOf } from './keys'
import { whenKeysAreLost } from './keys_lost'

/** Actions of held keys -> axis and sign of the input. */
const HELD_ACTIONS = {
  forward: ['throttle', 1],
  reverse: ['throttle', -1],
  left: ['steering', 1],
  right: ['steering', -1],
} as const

/** Handles keyboard events; calls `onAction` for keys that are not held. */
export function listenToKeyboard(driver: Driver, store: Store, onAction: (action: KeyAction) => void): void {
  const held = new Map<string, keyof typeof HELD_ACTIONS>()
  /** Keys that move the fly camera, and what they stand for, by KeyboardEvent.code. */
  const flying = new Map<string, string>()

  function update(): void {
    driver.keys.throttle = driver.keys.steering = 0
    for (const action of new Set(held.values())) {
      const [axis, sign] = HELD_ACTIONS[action]
      driver.keys[axis] += sign
    }
    driver.change()
  }

  function fly(): void {
    Object.assign(store.flyInput, { ahead: 0, left: 0, up: 0, turn: 0, tilt: 0 })
    for (const code of flying.values()) {
      const [axis, sign] = FLY_KEYS[code]
      store.flyInput[axis] += sign
    }
  }

  /** Releases all keys. */
  function releaseAll(): void {
    held.clear()
    flying.clear()
    fly()
    driver.stop()
  }

  window.addEventListener('keydown', (event) => {
    store.flyInput.isFast = event.shiftKey
    if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing) return
    const field = event.target instanceof HTMLElement ? event.target.closest<HTMLElement>(FIELDS) : null
    if (field) {
      if (event.key === 'Escape') field.blur() // return the focus, so that keys drive
      return
    }
    if (store.isFlying && codeOf(event) in FLY_KEYS) {
      event.preventDefault()
      flying.set(event.code, codeOf(event))
      return fly()
    }
    const action = actionOf(event)
    if (!action) return
    event.preventDefault()
    if (event.repeat && !keyOf(event)?.isRepeated) return
    if (!isHeld(action)) return onAction(action)
    held.set(event.code, action)
    update()
  })
  window.addEventListener('keyup', (event) => {
    store.flyInput.isFast = event.shiftKey
    if (held.delete(event.code)) update()
    if (flying.delete(event.code)) fly()
  })
  whenKeysAreLost(releaseAll)
  document.addEventListener('focusin', (event) => {
    if (held.size + flying.size > 0 && event.target instanceof Element && event.target.closest(FIELDS)) releaseAll()
  })
  let wasFlying = store.isFlying
  const changeOver = () => {
    if (wasFlying !== store.isFlying) releaseAll() // keys that are held do not go on with the other one
    wasFlying = store.isFlying
  }
  for (const one of [store.camera, store.isEditing, store.isBuilding]) one.watch(changeOver)
}

function isHeld(action: KeyAction): action is keyof typeof HELD_ACTIONS {
  return action in HELD_ACTIONS
}
