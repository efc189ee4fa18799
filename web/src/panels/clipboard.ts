// Copies the text of an element to the clipboard, and finds commands in texts.

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

/** A command at the end of a sentence, such as 'Install it: pip install zstandard'. */
const COMMAND = /^(.*?: +)((?:sudo |\S*\/)?(?:pip|uv|apt-get|autodrive|python[\d.]*|scripts\/\S+) .*?)([.]?)$/s

/** What is before a command in a text, and the command; null if there is none. */
export function splitCommand(text: string): readonly [before: string, command: string] | null {
  const found = COMMAND.exec(text)
  return found && [found[1], found[2]]
}
