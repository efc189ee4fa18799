// Short calm lines at the bottom: collisions, leaving the road, and what else the person is told.
import { sentence } from '../actions'
import type { Event } from '../messages'
import type { Store } from '../store'
import { h } from './element'

/** How long a line stays [ms]. */
const STAY = 5000
/** The same within that time is counted on the line that is there. */
const MOST = 3

type Tone = 'plain' | 'warn' | 'good'

interface Line {
  element: HTMLElement
  times: HTMLElement
  count: number
  timer: number
}

export function notices(store: Store): HTMLElement {
  const list = h('div', { class: 'notices', testid: 'notices', role: 'status', 'aria-live': 'polite' })
  const lines = new Map<string, Line>()

  function tell(text: string, tone: Tone, isCounted: boolean): void {
    let line = lines.get(text)
    if (line) {
      window.clearTimeout(line.timer)
      if (isCounted) line.times.textContent = `× ${++line.count}`
    } else {
      const times = h('span', { class: 'times' })
      const element = h('div', { class: 'notice', 'data-tone': tone, onclick: () => end(text) }, text, times)
      line = { element, times, count: 1, timer: 0 }
      lines.set(text, line)
      list.append(element)
      if (lines.size > MOST) end(lines.keys().next().value!)
    }
    line.timer = window.setTimeout(() => end(text), STAY)
  }

  function end(text: string): void {
    window.clearTimeout(lines.get(text)?.timer)
    lines.get(text)?.element.remove()
    lines.delete(text)
  }

  store.notice.watch((text) => {
    if (text) tell(sentence(text), 'plain', false)
  })
  store.events.watch((events) => {
    for (const event of events) tell(...words(event), true)
  })
  return list
}

function words(event: Event): [string, Tone] {
  switch (event.type) {
    case 'Collision':
      return [`${event.vehicle} hit ${event.other}`, 'warn']
    case 'OffRoad':
      return [`${event.vehicle} left the road`, 'warn']
    case 'BackOnRoad':
      return [`${event.vehicle} is back on the road`, 'good']
  }
}
