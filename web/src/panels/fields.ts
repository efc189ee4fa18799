// Building blocks of panels: rows with a button and its state, selections, button groups.

import type { Attributes, Child } from './element'
import { h } from './element'

/** A section with a title. */
export function section(title: string, ...children: Child[]): HTMLElement {
  return h('section', { class: 'section' }, h('h2', {}, title), ...children)
}

/** A button with its state beside it. */
export function row(button: HTMLElement, state: HTMLElement): HTMLElement {
  return h('div', { class: 'row' }, button, state)
}

/** A text that a screen reader announces when it changes. */
export function state(testid: string): HTMLElement {
  return h('span', { class: 'state', testid, role: 'status' })
}

/** A label and a field in one line. */
export function labelled(label: string, field: HTMLElement): HTMLElement {
  return h('label', { class: 'labelled' }, h('span', {}, label), field)
}

/** A drop-down list; calls `choose` when the user selects an option. */
export function choice(
  testid: string,
  choose: (value: string) => void,
  attributes: Attributes = {},
): HTMLSelectElement {
  let isPointed = false // after a selection with the mouse, keys drive again
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

/** Sets the options (value -> label) of a drop-down list if they changed. */
export function setOptions(select: HTMLSelectElement, options: Record<string, string>): void {
  const key = JSON.stringify(options)
  if (select.dataset.options === key) return
  select.dataset.options = key
  const value = select.value
  select.replaceChildren(...Object.entries(options).map(([name, label]) => h('option', { value: name }, label)))
  if (value in options) select.value = value
}

/** A group of buttons, one per option; calls `choose` when the user selects one. */
export function segments<T extends string>(
  testid: string,
  label: string,
  options: readonly (readonly [value: T, label: string])[],
  choose: (value: T) => void,
): { element: HTMLElement; show: (value: string) => void } {
  const buttons = options.map(([value, label]) =>
    h('button', { type: 'button', value, 'aria-pressed': 'false', onclick: () => choose(value) }, label),
  )
  return {
    element: h('div', { class: 'segments', role: 'group', 'aria-label': label, testid }, ...buttons),
    show: (value) => {
      for (const button of buttons) button.setAttribute('aria-pressed', String(button.value === value))
    },
  }
}

/** The heading above a list of errors. */
export function errorCount(count: number): string {
  if (count === 0) return 'No errors'
  return count === 1 ? '1 error' : `${count} errors`
}
