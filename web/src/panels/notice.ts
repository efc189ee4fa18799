// Notices at the bottom of the page: collisions, road departures, results of actions; errors stay until they are closed.
import { sentence } from '../actions'
import { describe, isDetail, type Level } from '../log'
import type { Store } from '../store'
import { copyButton, splitCommand } from './clipboard'
import { h } from './element'

/** How long a notice is shown [ms]. A repeated event is counted on the notice that is shown. */
const DURATION = 5000
/** Maximum number of notices. */
const MAX_NOTICES = 3

interface Notice {
  element: HTMLElement
  times: HTMLElement
  count: number
  /** 0: it stays until it is closed. */
  timer: number
}

/** An error with a button that closes it, and one that copies the command in its text. */
function errorOf(text: string, close: () => void): HTMLElement {
  const found = splitCommand(text)
  const command = found && h('code', {}, found[1])
  const copy = command && copyButton('notice-copy', command)
  const words = h('span', {}, ...(found ? [found[0], command] : [text]))
  const end = h('button', { testid: 'notice-close', 'aria-label': 'Close the error', onclick: close }, 'Close')
  return h('div', { class: 'notice', 'data-severity': 'error', role: 'alert' }, words, copy, end)
}

export function notices(store: Store): HTMLElement {
  const list = h('div', { class: 'notices', testid: 'notices', role: 'status', 'aria-live': 'polite' })
  const notices_ = new Map<string, Notice>()

  function show(text: string, severity: Level, isCounted: boolean): void {
    let notice = notices_.get(text)
    if (notice) {
      window.clearTimeout(notice.timer)
      if (isCounted) notice.times.textContent = `× ${++notice.count}`
    } else {
      const times = h('span', { class: 'times' })
      const element =
        severity === 'error'
          ? errorOf(text, () => remove(text))
          : h('div', { class: 'notice', 'data-severity': severity, onclick: () => remove(text) }, text, times)
      notice = { element, times, count: 1, timer: 0 }
      notices_.set(text, notice)
      list.append(element)
      const texts = [...notices_.keys()]
      const oldest = texts.find((one) => notices_.get(one)?.timer !== 0) ?? texts[0]
      if (notices_.size > MAX_NOTICES) remove(oldest)
    }
    if (severity !== 'error') notice.timer = window.setTimeout(() => remove(text), DURATION)
  }

  function remove(text: string): void {
    window.clearTimeout(notices_.get(text)?.timer)
    notices_.get(text)?.element.remove()
    notices_.delete(text)
  }

  store.notice.watch((text) => {
    if (text) show(sentence(text), 'info', false)
  })
  store.error.watch((text) => {
    if (text) show(sentence(text), 'error', false)
  })
  store.warning.watch((text) => {
    if (text) show(sentence(text), 'warning', false)
  })
  store.told.watch((events) => {
    for (const event of events) if (!isDetail(event)) show(...describe(event, store.scene.value), true)
  })
  return list
}
