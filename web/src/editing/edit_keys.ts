// Keys of Edit mode: they move and turn the selected thing, undo and redo. Keys do not drive meanwhile.
import { codeOf } from '../driving/keys'
import { whenKeysAreLost } from '../driving/keys_lost'
import { FIELDS } from '../fields'
import type { Store } from '../store'
import type { Editor } from './editor'

/** Step of a key [m], [rad]; with Shift the second. */
const STEP = [0.05, 0.01] as const
const TURN = [Math.PI / 12, Math.PI / 180] as const

/** Steps along x and y of the map, and to the left; Edit mode starts with x to the right and y upwards. Brackets are
 * characters, which many layouts have elsewhere. */
const MOVES: Record<string, readonly [dx: number, dy: number, turn: number]> = {
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  ArrowLeft: [-1, 0, 0],
  ArrowRight: [1, 0, 0],
  '[': [0, 0, 1],
  ']': [0, 0, -1],
}
/** Driving keys without a meaning in Edit mode. */
const DRIVING = new Set(['KeyW', 'KeyA', 'KeyS', 'KeyD'])

export function listenToEditKeys(store: Store, editor: Editor, stopDriving: () => void): void {
  const held = new Set<string>()

  function onKey(event: KeyboardEvent): boolean {
    const hasAltGr = event.getModifierState('AltGraph') // Windows reports it as Ctrl and Alt
    if (!store.isEditing.value || event.isComposing || (event.altKey && !hasAltGr)) return false
    const isControlled = (event.ctrlKey && !hasAltGr) || event.metaKey
    const step = MOVES[event.key] ?? MOVES[codeOf(event)]
    if (event.target instanceof HTMLElement && event.target.closest(FIELDS)) return false
    if (isControlled && event.key.toLowerCase() === 'z') void (event.shiftKey ? editor.redo() : editor.undo())
    else if (isControlled && event.key.toLowerCase() === 'y') void editor.redo()
    else if (isControlled) return false
    else if (step) move(event, step)
    else if (event.key === 'Delete') void editor.remove()
    else if (event.key === 'Escape') close()
    else return DRIVING.has(event.code)
    return true
  }

  function move(event: KeyboardEvent, [dx, dy, turn]: (typeof MOVES)[string]): void {
    const which = event.shiftKey ? 1 : 0
    held.add(event.code)
    editor.shift(dx * STEP[which], dy * STEP[which], turn * TURN[which])
  }

  function close(): void {
    if (store.preview.value) editor.cancel()
    else store.isEditing.value = false
  }

  window.addEventListener(
    'keydown',
    (event) => {
      if (!onKey(event)) return
      event.preventDefault()
      event.stopImmediatePropagation()
    },
    { capture: true },
  )
  // one edit for all steps until the key is released
  const release = (): void => {
    held.clear()
    void editor.commit()
  }
  window.addEventListener('keyup', (event) => {
    if (held.delete(event.code) && held.size === 0) release()
  })
  whenKeysAreLost(() => held.size > 0 && release())
  store.isEditing.watch((isEditing) => isEditing && stopDriving())
}
