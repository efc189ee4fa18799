// Keyboard input (report, table 12): held keys drive, other keys run an action once.
import type { Driver } from './driver'
import type { KeyAction } from './keys'
import { actionOf, keyOf } from './keys'

/** Elements that need the keys themselves; keys do not drive while one has the focus. */
const FIELDS = 'input, select, textarea, dialog, [contenteditable]'

/** Actions of held keys -> axis and sign of the input. */
const HELD_ACTIONS = {
  forward: ['throttle', 1],
  reverse: ['throttle', -1],
  left: ['steering', 1],
  right: ['steering', -1],
} as const

/** Handles keyboard events; calls `onAction` for keys that are not held. */
export function listenToKeyboard(driver: Driver, onAction: (action: KeyAction) => void): void {
  const held = new Map<string, keyof typeof HELD_ACTIONS>()

  function update(): void {
    driver.keys.throttle = driver.keys.steering = 0
    for (const action of new Set(held.values())) {
      const [axis, sign] = HELD_ACTIONS[action]
      driver.keys[axis] += sign
    }
    driver.change()
  }

  /** Releases all keys: the page gets no keyup event for a key that is released elsewhere. */
  function releaseAll(): void {
    held.clear()
    driver.stop()
  }

  window.addEventListener('keydown', (event) => {
    if (event.key === 'Meta') return releaseAll() // while Meta is down, browsers send no keyup events
    if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing) return
    const field = event.target instanceof HTMLElement ? event.target.closest<HTMLElement>(FIELDS) : null
    if (field) {
      if (event.key === 'Escape') field.blur() // return the focus, so that keys drive
      return
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
    if (held.delete(event.code)) update()
  })
  window.addEventListener('blur', releaseAll)
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) releaseAll()
  })
  document.addEventListener('focusin', (event) => {
    if (held.size > 0 && event.target instanceof Element && event.target.closest(FIELDS)) releaseAll()
  })
}

function isHeld(action: KeyAction): action is keyof typeof HELD_ACTIONS {
  return action in HELD_ACTIONS
}
