// The line in the toolbar while there is no connection; the page keeps its last picture meanwhile.
import type { Store } from '../store'
import { h, setText } from './element'

/** A connection that comes at once is not worth a line [ms]. */
const PATIENCE = 400

export function banner(store: Store): HTMLElement {
  const text = h('span')
  const spinner = h('i', { class: 'spinner' })
  const line = h('div', { class: 'banner', testid: 'banner', role: 'alert', hidden: true }, spinner, text)
  let timer = 0
  store.link.watch((link) => {
    window.clearTimeout(timer)
    if (link === 'open') {
      line.hidden = true
      return
    }
    line.title = store.lost.value
    setText(text, link === 'connecting' ? 'Connecting to the simulator…' : `Reconnecting… ${store.lost.value}`)
    if (link === 'lost') line.hidden = false
    else timer = window.setTimeout(() => (line.hidden = false), PATIENCE)
  })
  return line
}
