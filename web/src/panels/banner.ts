// The message in the toolbar while there is no connection (the page keeps the last image) or the physics cannot continue.
import { type Actions, sentence } from '../actions'
import type { Store } from '../store'
import { h, setText } from './element'

/** Delay before the first message [ms]; most connections open sooner. */
const DELAY = 400

export function banner(store: Store, actions: Actions): HTMLElement {
  const text = h('span')
  const spinner = h('i', { class: 'spinner' })
  const reset = h('button', { testid: 'banner-reset', onclick: () => void actions.reset() }, 'Reset')
  const line = h('div', { class: 'banner', testid: 'banner', role: 'alert', hidden: true }, spinner, text, reset)
  let timer = 0
  store.link.watch((link) => {
    window.clearTimeout(timer)
    spinner.hidden = link === 'open'
    reset.hidden = link !== 'open'
    if (link === 'open') {
      line.hidden = true
      return
    }
    line.title = store.connectionError.value
    setText(
      text,
      link === 'connecting' ? 'Connecting to the simulator…' : `Reconnecting… ${store.connectionError.value}`,
    )
    if (link === 'lost') line.hidden = false
    else timer = window.setTimeout(() => (line.hidden = false), DELAY)
  })
  store.status.watch((status) => {
    if (store.link.value !== 'open') return
    line.hidden = !status?.error
    line.title = status?.error ?? ''
    setText(text, sentence(status?.error ?? ''))
  })
  return line
}
