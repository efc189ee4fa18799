// Parts of which panels are made: rows with a button and its state, choices, switches.
import { h } from './element'
import type { Attributes, Child } from './element'

/** A titled group of a panel. */
export function section(title: string, ...children: Child[]): HTMLElement {
  return h('section', { class: 'section' }, h('h2', {}, title), ...children)
}

/** A button with what it switched beside it. */
export function row(button: HTMLElement, state: HTMLElement): HTMLElement {
  return h('div', { class: 'row' }, button, state)
}

/** Live text beside a button, which a screen reader tells when it changes. */
export function state(testid: string): HTMLElement {
  return h('span', { class: 'state', testid, role: 'status' })
}

/** A labelled field or choice, one line. */
export function labelled(label: string, field: HTMLElement): HTMLElement {
  return h('label', { class: 'labelled' }, h('span', {}, label), field)
}

/** A choice of a few named things; `choose` is called when the person picked one. */
export function choice(
  testid: string,
  choose: (value: string) => void,
  attributes: Attributes = {},
): HTMLSelectElement {
  let isPointed = false // picked with the mouse: hand the keyboard back to driving
  const select = h('select', {
    testid,
    onpointerdown: () => (isPointed = true),
    onkeydown: () => (isPointed = false),
    onchange: () => {
      choose(select.value)
      if (isPointed) select.blur()
    },
    ...attributes,
  })
  return select
}

/** Puts these options (value -> words) into a choice, if they are others than before. */
export function setOptions(select: HTMLSelectElement, options: Record<string, string>): void {
  const key = JSON.stringify(options)
  if (select.dataset.options === key) return
  select.dataset.options = key
  const value = select.value
  select.replaceChildren(...Object.entries(options).map(([name, words]) => h('option', { value: name }, words)))
  if (value in options) select.value = value
}

/** A choice that shows all its options side by side. `choose` is called when the person picked one. */
export function segments<T extends string>(
  testid: string,
  label: string,
  options: readonly (readonly [value: T, words: string])[],
  choose: (value: T) => void,
): { element: HTMLElement; show: (value: string) => void } {
  const buttons = options.map(([value, words]) =>
    h('button', { type: 'button', value, 'aria-pressed': 'false', onclick: () => choose(value) }, words),
  )
  return {
    element: h('div', { class: 'segments', role: 'group', 'aria-label': label, testid }, ...buttons),
    show: (value) => {
      for (const button of buttons) button.setAttribute('aria-pressed', String(button.value === value))
    },
  }
}
