// What the keys of Edit and Build mode share: they come before all other keys, do not drive, undo and redo.
import type { Observable } from '../observable'
import type { Editor } from './editor'

/** Whether Ctrl or Cmd is held; Windows reports AltGr as Ctrl and Alt. */
export function isControlled(event: KeyboardEvent): boolean {
  return (event.ctrlKey && !event.getModifierState('AltGraph')) || event.metaKey
}

/** Actions of Ctrl and a letter; the argument says whether Shift is held. */
export function undoKeys(editor: Editor): Record<string, (isShifted: boolean) => void> {
  return {
    z: (isShifted) => void (isShifted ? editor.redo() : editor.undo()),
    y: () => void editor.redo(),
  }
}

/** Calls `onKey` for the keys of a mode while it is on; a key for which it returns true does nothing else. */
export function listenToModeKeys(
  isOn: Observable<boolean>,
  onKey: (event: KeyboardEvent) => boolean,
  stopDriving: () => void,
): void {
  window.addEventListener(
    'keydown',
    (event) => {
      if (!isOn.value || event.isComposing || !onKey(event)) return
      event.preventDefault()
      event.stopImmediatePropagation()
    },
    { capture: true },
  )
  isOn.watch((isNow) => isNow && stopDriving())
}
