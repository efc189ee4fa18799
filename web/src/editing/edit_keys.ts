// Keys of Edit mode: they move and turn the selected thing, undo and redo. Keys do not drive meanwhile.
import { codeOf } from '../driving/keys'
import { whenKeysAreLost } from '../driving/keys_lost'
import { FIELDS } from '../fields'
import type { Store } from '../store'
import type { Editor } from './editor'
import { isControlled, listenToModeKeys, undoKeys } from './mode_keys'

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
  const controlled = undoKeys(editor)

  function onKey(event: KeyboardEvent): boolean {
    if (event.altKey && !event.getModifierState('AltGraph')) return false
    if (event.target instanceof HTMLElement && event.target.closest(FIELDS)) return false
    const step = MOVES[event.key] ?? MOVES[codeOf(event)]
    if (isControlled(event)) {
      const act = controlled[event.key.toLowerCase()]
      act?.(event.shiftKey)
      return act !== undefined
    }
    if (step) move(event, step)
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

  listenToModeKeys(store.isEditing, onKey, stopDriving)
  // one edit for all steps until the key is released
  const release = (): void => {
    held.clear()
    void editor.commit()
  }
  window.addEventListener('keyup', (event) => {
    if (held.delete(event.code) && held.size === 0) release()
  })
  whenKeysAreLost(() => held.size > 0 && release())
}
