// The keyboard of the report's table 12: keys held down drive, other keys do something once.
import type { Driver } from './driver'
import { deedOf } from './keys'
import type { Deed } from './keys'

/** Where keys are letters, or turn a choice, and not commands. */
const FIELDS = 'input, select, textarea, dialog, [contenteditable]'

/** Held deed -> what it pushes. */
const PUSHES = {
  forward: ['throttle', 1],
  reverse: ['throttle', -1],
  left: ['steering', 1],
  right: ['steering', -1],
} as const

/** Listens from now on; `once` is called for keys that do something once. */
export function listenToKeyboard(driver: Driver, once: (deed: Deed) => void): void {
  const held = new Map<string, keyof typeof PUSHES>()

  function push(): void {
    driver.keys.throttle = driver.keys.steering = 0
    for (const deed of new Set(held.values())) {
      const [axis, sign] = PUSHES[deed]
      driver.keys[axis] += sign
    }
    driver.change()
  }

  /** Nothing is held any more: what is let go elsewhere is not told to this page. */
  function letGo(): void {
    held.clear()
    driver.stop()
  }

  window.addEventListener('keydown', (event) => {
    if (event.key === 'Meta') return letGo() // a key let go while it is down is never told
    if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing) return
    const field = event.target instanceof HTMLElement ? event.target.closest<HTMLElement>(FIELDS) : null
    if (field) {
      if (event.key === 'Escape') field.blur() // keys drive again
      return
    }
    const deed = deedOf(event)
    if (!deed) return
    event.preventDefault()
    if (event.repeat) return
    if (!isPush(deed)) return once(deed)
    held.set(event.code, deed)
    push()
  })
  window.addEventListener('keyup', (event) => {
    if (held.delete(event.code)) push()
  })
  window.addEventListener('blur', letGo)
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) letGo()
  })
  document.addEventListener('focusin', (event) => {
    if (held.size > 0 && event.target instanceof Element && event.target.closest(FIELDS)) letGo()
  })
}

function isPush(deed: Deed): deed is keyof typeof PUSHES {
  return deed in PUSHES
}
