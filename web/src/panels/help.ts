// The help dialog: all keys, mouse, touch and gamepad controls.

import { knownCaps } from '../driving/key_caps'
import type { Key } from '../driving/keys'
import { KEYS } from '../driving/keys'
import { h } from './element'

/** Caps are separated by ' | '. */
const OTHERS: Record<string, readonly [string, string][]> = {
  Mouse: [
    ['Click', 'Use buttons and fields'],
    ['Wheel', 'Zoom; up is nearer'],
    ['Drag', 'Rotate the Orbit camera, turn the Fly camera'],
  ],
  'Fly camera': [
    ['{KeyW} | {KeyS} | {KeyA} | {KeyD}', 'Ahead, back, to the left, to the right; these keys do not drive meanwhile'],
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
    ['{KeyN}', 'Go to the next open end'],
    ['Page Up | Page Down', 'Another piece'],
    ['Arrows', 'Move the piece in hand or what is selected by 10 cm; with Shift by 1 cm'],
    ['{KeyR} | Shift | {KeyR}', 'Turn to the next or previous end'],
    ['{KeyM}', 'Mirror'],
    ['{KeyC}', 'Close the loop'],
    ['Enter', 'Set the piece'],
    ['Shift', 'With a click: select several pieces; with a drag: a rectangle; with a piece in hand: do not snap'],
    ['{KeyG}', 'Select the connected pieces'],
    ['Delete', 'Remove what is selected or in hand'],
    ['Ctrl | D', 'Take a copy of what is selected'],
    ['Home', 'Show the whole map'],
    ['Esc', 'Delete the piece in hand; then select nothing'],
  ],
  'Race track in Build mode': [
    ['Drag', 'Move a point; a click on the line adds one'],
    ['{KeyN} | Shift | {KeyN}', 'Select the next or previous point'],
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

/** A line that is shown while the layout of the keyboard is not known. */
export function positionNote(): HTMLElement {
  const note = h('p', { class: 'by-position' }, 'Letters are those of a US keyboard: the position of the key counts.')
  knownCaps.watch((caps) => (note.hidden = caps.has('KeyW')))
  return note
}

/** `startTour` begins the tour of the page. */
export function help(startTour: () => void): { element: HTMLDialogElement; toggle: () => void } {
  const body = h('div', { class: 'help-body' }, ...lists())
  const close = () => element.close()
  const begin = () => {
    close()
    startTour()
  }
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
    h(
      'header',
      {},
      h('h2', {}, 'Keys and controls'),
      h('button', { class: 'live', testid: 'help-tour', onclick: begin }, 'Start the tour'),
      h('button', { testid: 'help-close', onclick: close }, 'Close'),
    ),
    positionNote(),
    body,
  )
  return { element, toggle: () => (element.open ? element.close() : element.showModal()) }
}

function lists(): HTMLElement[] {
  const keys = Object.entries(KEYS).map(([title, all]) =>
    list(
      title,
      all.map((key) => [caps(key), key.description]),
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

/** Caps of a key on the keyboard of the user. */
function caps({ isShifted, characters = [], codes }: Key): HTMLElement[] {
  return [...(isShifted ? ['Shift'] : []), ...characters.slice(0, 1), ...codes.map((code) => `{${code}}`)].map((name) =>
    h('kbd', {}, name),
  )
}
