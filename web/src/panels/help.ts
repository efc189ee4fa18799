// The help: every key, mouse, touch and gamepad, over the page.
import { KEYS } from '../driving/keys'
import type { Key } from '../driving/keys'
import { h } from './element'

const NAMES: Record<string, string> = {
  ArrowUp: '↑',
  ArrowDown: '↓',
  ArrowLeft: '←',
  ArrowRight: '→',
  Escape: 'Esc',
  Backspace: '⌫',
}

const OTHERS: Record<string, readonly [string, string][]> = {
  'Mouse and touch': [
    ['Click', 'Buttons and fields'],
    ['Wheel', "Zoom in the Bird's Eye and in Orbit"],
    ['Drag', 'Turn in Orbit'],
    ['Pads', 'Left steers, right drives, on a touch screen'],
  ],
  Gamepad: [
    ['Left stick', 'Steer'],
    ['Triggers', 'Right drives forward, left in reverse'],
    ['A, Y', 'Low beam, high beam'],
    ['LB, RB, B', 'Left, right, hazard indicators'],
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
      onclick: (event: MouseEvent) => event.target === element && element.close(), // beside it
      onkeydown: (event: KeyboardEvent) => {
        if (event.key !== '?' && event.key !== 'F1') return
        event.preventDefault()
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
  const keys = Object.entries(KEYS).map(([title, all]) => list(title, all.map((key) => [caps(key, layout), key.says])))
  const others = Object.entries(OTHERS).map(([title, all]) =>
    list(title, all.map(([name, says]) => [[h('kbd', { class: 'wide' }, name)], says])),
  )
  return [...keys, ...others]
}

function list(title: string, rows: readonly [HTMLElement[], string][]): HTMLElement {
  const parts = rows.flatMap(([keys, says]) => [h('dt', {}, ...keys), h('dd', {}, says)])
  return h('section', {}, h('h3', {}, title), h('dl', {}, ...parts))
}

/** The caps of a key as this keyboard has them. */
function caps(key: Key, layout: Layout | undefined): HTMLElement[] {
  const codes = key.isShifted ? ['Shift', ...key.codes] : key.codes
  return codes.map((code) => h('kbd', {}, NAMES[code] ?? layout?.get(code)?.toUpperCase() ?? code.replace(/^Key/, '')))
}

/** What is printed on the keys, where the browser tells. */
async function layoutMap(): Promise<Layout | undefined> {
  const { keyboard } = navigator as { keyboard?: { getLayoutMap?: () => Promise<Layout> } }
  try {
    return await keyboard?.getLayoutMap?.()
  } catch {
    return undefined
  }
}
