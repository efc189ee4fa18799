// What is printed on the keys of the user: from the browser, else learnt from the keys that are pressed.
import { Observable } from '../observable'

/** Caps that are the same on all keyboards. */
const FIXED: Record<string, string> = {
  ArrowUp: '↑',
  ArrowDown: '↓',
  ArrowLeft: '←',
  ArrowRight: '→',
  Escape: 'Esc',
  Backspace: '⌫',
  NumpadAdd: 'Num +',
  NumpadSubtract: 'Num −',
}

/** Cap of each key whose cap is known, by KeyboardEvent.code. */
export const knownCaps = new Observable<ReadonlyMap<string, string>>(new Map())

interface Keyboard {
  getLayoutMap?: () => Promise<ReadonlyMap<string, string>>
}

/** Asks the browser for the keyboard layout, now and when the page gets the focus, and learns from pressed keys. */
export function learnKeyCaps(): void {
  const ask = async (): Promise<void> => {
    const { keyboard } = navigator as { keyboard?: Keyboard }
    // a page inside another one may not ask: it learns
    const layout = await keyboard?.getLayoutMap?.().catch(() => undefined)
    if (layout) knownCaps.value = new Map(layout)
  }
  void ask()
  window.addEventListener('focus', () => void ask())
  const learn = ({ code, key, ctrlKey, altKey, metaKey }: KeyboardEvent): void => {
    if (!code.startsWith('Key') || key.length !== 1 || ctrlKey || altKey || metaKey) return
    if (capOf(code) !== key.toUpperCase() || !knownCaps.value.has(code))
      knownCaps.value = new Map([...knownCaps.value, [code, key]])
  }
  window.addEventListener('keydown', learn, { capture: true })
}

/** Cap of the key with that KeyboardEvent.code; the one of a US keyboard if it is not known. */
export function capOf(code: string): string {
  if (!code.startsWith('Key')) return FIXED[code] ?? code.replace('Digit', '') // AZERTY prints digits, too
  return knownCaps.value.get(code)?.toUpperCase() ?? code.slice(3)
}

const KEY = /\{((?:Key|Digit|Arrow|Numpad|F1)\w*|Escape|Backspace)\}/g
/** Keys in a row. */
const KEYS = new RegExp(`${KEY.source}( ${KEY.source})*`, 'g')

/** Whether a text names keys: 'Build ({KeyZ})'. */
export function namesKeys(text: string): boolean {
  return text.search(KEY) >= 0
}

/** A text with the caps of the keys that it names. In a sentence, keys whose caps are not known are 'W A by position'. */
export function keyText(text: string): string {
  return text.replace(KEYS, (names: string) => {
    const codes = [...names.matchAll(KEY)].map(([, code]) => code)
    const isKnown = codes.every((code) => !code.startsWith('Key') || knownCaps.value.has(code))
    return codes.map(capOf).join(' ') + (isKnown || names === text ? '' : ' by position')
  })
}
