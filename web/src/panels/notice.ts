// Short notices at the bottom of the page: collisions, road departures, results of actions.
import { sentence } from '../actions'
import { describe, type Level } from '../log'
import type { Store } from '../store'
import { h } from './element'

/** How long a notice is shown [ms]. A repeated event is counted on the notice that is shown. */
const DURATION = 5000
/** Maximum number of notices. */
const MAX_NOTICES = 3

interface Notice {
  element: HTMLElement
  times: HTMLElement
  count: number
  timer: number
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
      const element = h('div', { class: 'notice', 'data-severity': severity, onclick: () => remove(text) }, text, times)
      notice = { element, times, count: 1, timer: 0 }
      notices_.set(text, notice)
      list.append(element)
      const [oldest = ''] = notices_.keys()
      if (notices_.size > MAX_NOTICES) remove(oldest)
    }
    notice.timer = window.setTimeout(() => remove(text), DURATION)
  }

  function remove(text: string): void {
    window.clearTimeout(notices_.get(text)?.timer)
    notices_.get(text)?.element.remove()
    notices_.delete(text)
  }

  store.notice.watch((text) => {
    if (text) show(sentence(text), 'info', false)
  })
  store.warning.watch((text) => {
    if (text) show(sentence(text), 'warning', false)
  })
  store.events.watch((events) => {
    for (const event of events) if (event.type !== 'CheckpointPassed') show(...describe(event), true)
  })
  return list
}
