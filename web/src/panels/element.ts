// Creates DOM elements: h('button', { class: 'quiet', onclick: ... }, 'Menu').
import { keyText, knownCaps, namesKeys } from '../driving/key_caps'

export type Child = Node | string | null | undefined | false

/** HTML attributes; `on...` are event listeners; true is an empty attribute; false, null and undefined are omitted. */
export type Attributes = Record<string, string | number | boolean | null | undefined | ((event: never) => void)>

/** Creates an element. `testid` becomes data-testid, and '{KeyZ}' in a text the cap of that key. */
export function h<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[Tag] {
  const element = document.createElement(tag)
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === 'function') element.addEventListener(name.slice(2), value as EventListener)
    else if (value !== false && value !== null && value !== undefined)
      write(value === true ? '' : String(value), (text) =>
        element.setAttribute(name === 'testid' ? 'data-testid' : name, text),
      )
  }
  for (const child of children) {
    if (typeof child !== 'string') element.append(...(child ? [child] : []))
    else if (child) {
      const text = document.createTextNode('')
      write(child, (words) => (text.data = words))
      element.append(text)
    }
  }
  return element
}

/** Writes a text; if it names keys, again when more is known about the keyboard. */
function write(text: string, set: (text: string) => void): void {
  if (namesKeys(text)) knownCaps.watch(() => set(keyText(text)))
  else set(text)
}

/** Creates an icon from a path on a 24 x 24 grid, in the colour of the text. */
export function icon(path: string): SVGSVGElement {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg')
  svg.setAttribute('viewBox', '0 0 24 24')
  svg.setAttribute('class', 'icon')
  svg.setAttribute('aria-hidden', 'true')
  const shape = document.createElementNS('http://www.w3.org/2000/svg', 'path')
  shape.setAttribute('d', path)
  svg.append(shape)
  return svg
}

/** Sets the text if it differs, so that unchanged text causes no layout and no announcement by a screen reader. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text
}

/** Minutes since midnight as '18:30'. */
export function clockTime(minutes: number): string {
  const whole = Math.round(minutes) % (24 * 60)
  return `${String(Math.floor(whole / 60)).padStart(2, '0')}:${String(whole % 60).padStart(2, '0')}`
}
