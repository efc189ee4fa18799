// The log panel: time, level and text of all notices, the latest at the bottom.
import type { Entry, Level } from '../log'
import { Observable } from '../observable'
import type { Store } from '../store'
import { h } from './element'
import { clock, NONE } from './hud_rows'

const LEVELS: Record<Level, string> = { info: 'Info', good: 'Info', warning: 'Warning', error: 'Error' }

export function logPanel(store: Store, entries: Observable<readonly Entry[]>): HTMLElement {
  const body = h('tbody', { testid: 'log-entries' })
  const heads = ['Time', 'Simulated', 'Level', 'Text'].map((title) => h('th', { scope: 'col' }, title))
  const scroller = h('div', { class: 'log-scroll', tabindex: 0, role: 'log', 'aria-label': 'Entries of the log' })
  scroller.append(h('table', {}, h('thead', {}, h('tr', {}, ...heads)), body))
  const areDetailsShown = new Observable(false)
  const details = h(
    'button',
    { testid: 'log-details', hidden: true, onclick: () => (areDetailsShown.value = !areDetailsShown.value) },
    'Checkpoints',
  )
  const close = () => (store.isLogOpen.value = false)
  const clear = () => (entries.value = [])
  const element = h(
    'aside',
    { class: 'card log', id: 'log', testid: 'log', 'aria-label': 'Log', hidden: true },
    h(
      'header',
      {},
      h('h2', {}, 'Log'),
      details,
      h('button', { testid: 'log-clear', onclick: clear }, 'Clear'),
      h('button', { testid: 'log-close', 'aria-label': 'Close the log', onclick: close }, 'Close'),
    ),
    scroller,
  )
  const shown = new Map<Entry, HTMLElement>()

  function show(all: readonly Entry[]): void {
    if (!store.isLogOpen.value) return
    const isAtEnd = scroller.scrollTop + scroller.clientHeight >= scroller.scrollHeight - 4
    details.hidden = !all.some((entry) => entry.isDetail)
    const wanted = areDetailsShown.value ? all : all.filter((entry) => !entry.isDetail)
    const kept = new Set(wanted)
    for (const [entry, row] of shown) {
      if (kept.has(entry)) continue
      row.remove()
      shown.delete(entry)
    }
    let row = body.firstElementChild
    for (const entry of wanted) {
      if (shown.get(entry) === row && row) row = row.nextElementSibling
      else shown.set(entry, body.insertBefore(rowOf(entry), row))
    }
    if (isAtEnd) scroller.scrollTop = scroller.scrollHeight
  }

  entries.watch(show)
  areDetailsShown.watch((areShown) => {
    details.setAttribute('aria-pressed', String(areShown))
    show(entries.value)
  })
  store.isLogOpen.watch((isOpen) => {
    element.hidden = !isOpen
    show(entries.value)
  })
  return element
}

function rowOf({ at, time, level, text }: Entry): HTMLElement {
  const cells = [at.toLocaleTimeString('en-GB'), time === null ? NONE : clock(time), LEVELS[level], text]
  return h('tr', { 'data-level': level }, ...cells.map((cell) => h('td', {}, cell)))
}
