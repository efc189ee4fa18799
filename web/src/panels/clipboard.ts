// Copies the text of an element to the clipboard, and finds commands in texts.
import { h, setText } from './element'

/** How long a button says that it has copied [ms]. */
const SHOWN = 2000

/** Selects the text of an element and copies it; returns whether the browser permitted that. */
export async function copyText(element: HTMLElement): Promise<boolean> {
  getSelection()?.selectAllChildren(element)
  try {
    await navigator.clipboard.writeText(element.textContent ?? '')
    return true
  } catch {
    // Browsers have no clipboard for pages that are not encrypted, except those of the same machine.
    return document.execCommand('copy')
  }
}

/** A button that copies the text of an element and says so for a moment; `done` gets whether it was copied. */
export function copyButton(
  testid: string,
  element: HTMLElement,
  { isPrimary = false, done = () => {} }: { isPrimary?: boolean; done?: (isCopied: boolean) => void } = {},
): HTMLButtonElement {
  let timer = 0
  const text = h('span', { role: 'status' }, 'Copy')
  const copy = async (): Promise<void> => {
    const isCopied = await copyText(element)
    setText(text, isCopied ? 'Copied' : 'Press Ctrl-C to copy the selected text')
    button.dataset.copied = String(isCopied)
    done(isCopied)
    window.clearTimeout(timer)
    if (isCopied) timer = window.setTimeout(() => setText(text, 'Copy'), SHOWN)
  }
  const button = h(
    'button',
    { type: 'button', testid, class: isPrimary && 'primary', onclick: () => void copy() },
    text,
  )
  return button
}

/** A command at the end of a sentence, such as 'Install it: pip install zstandard'. */
const COMMAND = /^(.*?: +)((?:sudo |\S*\/)?(?:pip|uv|apt-get|autodrive|python[\d.]*|scripts\/\S+) .*?)([.]?)$/s

/** What is before a command in a text, and the command; null if there is none. */
export function splitCommand(text: string): readonly [before: string, command: string] | null {
  const found = COMMAND.exec(text)
  return found && [found[1], found[2]]
}
