// Keys of Build mode: pieces, moves, turns, mirror images, undo and redo. Keys do not drive meanwhile.
import { codeOf } from '../driving/keys'
import { whenKeysAreLost } from '../driving/keys_lost'
import type { Editor } from '../editing/editor'
import { isControlled, listenToModeKeys, undoKeys } from '../editing/mode_keys'
import type { Store } from '../store'
import type { Builder } from './builder'

/** Elements that need the keys themselves; on a button, Enter presses it. */
const FIELDS = 'input:not([type="checkbox"]), select, textarea, dialog[open], [contenteditable]'
const DRIVING = new Set(['KeyW', 'KeyA', 'KeyS', 'KeyD'])

export function listenToBuildKeys(
  store: Store,
  builder: Builder,
  editor: Editor,
  showAll: () => void,
  stopDriving: () => void,
): void {
  /** Arrow keys that are held. */
  const held = new Set<string>()
  const actions: Record<string, (isShifted: boolean) => void> = {
    KeyR: (isShifted) => builder.turn(isShifted ? -1 : 1),
    KeyM: () => builder.mirror(),
    KeyN: () => builder.nextPort(),
    Period: () => builder.selectNext(1),
    Comma: () => builder.selectNext(-1),
    KeyC: () => void builder.close(),
    KeyG: () => builder.selectConnected(),
    PageDown: () => builder.step(1),
    PageUp: () => builder.step(-1),
    Home: showAll,
    ArrowRight: (isShifted) => builder.nudge(1, 0, isShifted),
    ArrowLeft: (isShifted) => builder.nudge(-1, 0, isShifted),
    ArrowUp: (isShifted) => builder.nudge(0, 1, isShifted),
    ArrowDown: (isShifted) => builder.nudge(0, -1, isShifted),
    Enter: () => void builder.set(),
    Delete: () => void builder.remove(),
    Backspace: () => void builder.remove(),
    Escape: () => builder.cancel(),
  }
  const controlled: Record<string, (isShifted: boolean) => void> = {
    ...undoKeys(editor),
    d: () => builder.duplicate(),
    a: () => builder.selectAll(),
  }

  function onKey(event: KeyboardEvent): boolean {
    if (event.altKey || !(event.target instanceof HTMLElement) || event.target.closest(FIELDS)) return false
    if (codeOf(event) === 'Enter' && event.target.closest('button')) return false
    const act = isControlled(event) ? controlled[event.key.toLowerCase()] : actions[codeOf(event)]
    if (!(codeOf(event) === 'Enter' && event.repeat)) act?.(event.shiftKey)
    if (codeOf(event).startsWith('Arrow')) held.add(event.code)
    // Enter then sets the piece in hand, and does not press the button once more
    if (builder.hand.value) event.target.closest('button')?.blur()
    return act !== undefined || (!isControlled(event) && DRIVING.has(codeOf(event)))
  }

  listenToModeKeys(store.isBuilding, onKey, stopDriving)
  const release = (): void => {
    held.clear()
    void builder.settle()
  }
  window.addEventListener('keyup', (event) => {
    if (held.delete(event.code) && held.size === 0) release()
  })
  whenKeysAreLost(() => held.size > 0 && release())
}
