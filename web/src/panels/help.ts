// The help dialog: all keys, mouse, touch and gamepad controls.

import type { Key } from '../driving/keys'
import { KEYS } from '../driving/keys'
import { h } from './element'

const NAMES: Record<string, string> = {
  ArrowUp: '↑',
  ArrowDown: '↓',
  ArrowLeft: '←',
  ArrowRight: '→',
  Escape: 'Esc',
  Backspace: '⌫',
  Equal: '+',
  Minus: '−',
  NumpadAdd: 'Num +',
  NumpadSubtract: 'Num −',
  Digit1: '1',
  Digit2: '2',
  Digit3: '3',
}

/** Caps are separated by ' | '. */
const OTHERS: Record<string, readonly [string, string][]> = {
  Mouse: [
    ['Click', 'Use buttons and fields'],
    ['Wheel', 'Zoom; up is nearer'],
    ['Drag', 'Rotate the Orbit camera, turn the Fly camera'],
  ],
  'Fly camera': [
    ['W | S | A | D', 'Ahead, back, to the left, to the right; these keys do not drive meanwhile'],
    ['← | → | ↑ | ↓', 'Turn to the left, to the right, upwards, downwards'],
    ['Page Up | Page Down', 'Up, down'],
    ['Shift', 'Faster'],
  ],
  Touch: [
    ['Left pad', 'Steer'],
    ['Right pad', 'Drive: up forward, down in reverse'],
    ['Drag', 'Rotate the Orbit camera, turn the Fly camera, which the pads move'],
    ['Two fingers', 'Zoom the Orbit camera'],
    ['Edit mode', 'Drag a vehicle or a box; its handle turns it'],
  ],
  'Edit mode': [
    ['Drag', 'Move a vehicle or a box; its handle turns it'],
    ['Arrows | [ | ]', 'Move and turn; with Shift in small steps'],
    ['Delete', 'Remove the selected box'],
    ['Ctrl | Z', 'Undo'],
    ['Ctrl | Shift | Z', 'Redo'],
  ],
  'Build mode': [
    ['Click', 'On an open end: offer pieces; on a piece: select it, then drag it'],
    ['N', 'Go to the next open end'],
    ['← | →', 'Another piece'],
    ['R | Shift | R', 'Turn to the next or previous end'],
    ['M', 'Mirror'],
    ['Enter', 'Set the piece'],
    ['Shift', 'With a click: select several pieces; with a drag: a rectangle; with a piece in hand: do not snap'],
    ['G', 'Select the connected pieces'],
    ['Delete', 'Remove what is selected'],
    ['Ctrl | D', 'Take a copy of what is selected'],
    ['Esc', 'Put the piece away; then leave'],
  ],
  'Race track in Build mode': [
    ['Drag', 'Move a point; a click on the line adds one'],
    ['N | Shift | N', 'Select the next or previous point'],
    ['Arrows', 'Move the selected point; with Shift in small steps'],
    ['Enter', 'Add a point after the selected one'],
    ['Delete', 'Delete the selected point'],
  ],
  Gamepad: [
    ['Left stick', 'Steer'],
    ['Triggers', 'Drive forward (right) or in reverse (left)'],
    ['A | Y', 'Low beam, high beam'],
    ['LB | RB | B', 'Left, right, hazard indicators'],
  ],
}

interface Layout {
  get(code: string): string | undefined
}

export function help(): { element: HTMLDialogElement; toggle: () => void } {
  const body = h('div', { class: 'help-body' })
  const close = () => element.close()
  const element = h(
    'dialog',
    {
      class: 'help',
      testid: 'help-dialog',
      'aria-label': 'Keys and controls',
      onclick: (event: MouseEvent) => event.target === element && element.close(), // a click outside the content
      onkeydown: (event: KeyboardEvent) => {
        // until the next image, a closed dialog may still have the focus: the key then opens it
        if (!element.open || (event.key !== '?' && event.key !== 'F1')) return
        event.preventDefault()
        event.stopPropagation()
        element.close()
      },
    },
    h('header', {}, h('h2', {}, 'Keys and controls'), h('button', { testid: 'help-close', onclick: close }, 'Close')),
    body,
  )

  async function open(): Promise<void> {
    element.showModal()
    body.replaceChildren(...lists(undefined))
    const layout = await layoutMap()
    if (layout) body.replaceChildren(...lists(layout))
  }

  return { element, toggle: () => (element.open ? element.close() : void open()) }
}

function lists(layout: Layout | undefined): HTMLElement[] {
  const keys = Object.entries(KEYS).map(([title, all]) =>
    list(
      title,
      all.map((key) => [caps(key, layout), key.description]),
    ),
  )
  const others = Object.entries(OTHERS).map(([title, all]) =>
    list(
      title,
      all.map(([names, description]) => [names.split(' | ').map((name) => h('kbd', {}, name)), description]),
    ),
  )
  const all = [...keys, ...others]
  // a phone has no keys
  const isFirst = (section: HTMLElement) => section.querySelector('h3')?.textContent === 'Touch'
  return matchMedia('(pointer: coarse)').matches ? all.sort((a, b) => Number(isFirst(b)) - Number(isFirst(a))) : all
}

function list(title: string, rows: readonly [HTMLElement[], string][]): HTMLElement {
  const parts = rows.flatMap(([keys, description]) => [h('dt', {}, ...keys), h('dd', {}, description)])
  return h('section', {}, h('h3', {}, title), h('dl', {}, ...parts))
}

/** Labels of a key on the keyboard of the user. */
function caps(key: Key, layout: Layout | undefined): HTMLElement[] {
  const codes = key.isShifted ? ['Shift', ...key.codes] : key.codes
  return codes.map((code) => h('kbd', {}, NAMES[code] ?? layout?.get(code)?.toUpperCase() ?? code.replace(/^Key/, '')))
}

/** The keyboard layout, if the browser supports it. */
async function layoutMap(): Promise<Layout | undefined> {
  const { keyboard } = navigator as { keyboard?: { getLayoutMap?: () => Promise<Layout> } }
  try {
    return await keyboard?.getLayoutMap?.()
  } catch {
    return undefined
  }
}
