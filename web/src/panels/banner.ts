// The message below the toolbar while the simulator starts, while there is no connection (the page keeps the last image),
// if the physics cannot continue, or if the page must be loaded again.
import { type Actions, sentence } from '../actions'
import type { Starting } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { clock } from './hud_rows'

/** What the page shows while there is no connection. */
function lost(store: Store): string {
  const time = store.frame.value ? ` The image and the HUD are those of ${clock(store.frame.value.time)}.` : ''
  return `${sentence(store.connectionError.value)} The page tries to connect again.${time}`
}

/** What the simulator does before it has a world. */
function starting({ stage, remaining }: Starting): string {
  return sentence(`${stage}${remaining === null ? '' : `: ${timeLeft(remaining)}`}`)
}

/** A time [s] as an estimate in words. */
function timeLeft(time: number): string {
  if (time > 90) return `about ${Math.round(time / 60)} minutes left`
  if (time > 45) return 'about a minute left'
  return time > 20 ? 'about half a minute left' : 'a few seconds left'
}

/** Delay before the first message [ms]; most connections open sooner. */
const DELAY = 400

export function banner(store: Store, actions: Actions): HTMLElement {
  const text = h('span')
  const spinner = h('i', { class: 'spinner' })
  const reset = h('button', { testid: 'banner-reset', onclick: () => void actions.reset() }, 'Reset')
  const reload = h('button', { testid: 'banner-reload', onclick: () => location.reload() }, 'Reload the page')
  const bar = h('progress', { testid: 'starting', 'aria-label': 'Start of the simulator' })
  const line = h(
    'div',
    { class: 'hint banner', testid: 'banner', role: 'alert', hidden: true },
    spinner,
    text,
    reset,
    reload,
    bar,
  )
  let timer = 0
  store.reloadReason.watch((reason) => {
    reload.hidden = !reason
    if (!reason) return
    spinner.hidden = reset.hidden = bar.hidden = true
    line.hidden = false
    setText(text, sentence(reason))
  })
  store.starting.watch((now) => {
    if (!now) return
    setText(text, starting(now))
    if (now.share === null) bar.removeAttribute('value')
    else bar.value = now.share
  })
  store.link.watch((link) => {
    if (store.reloadReason.value) return
    window.clearTimeout(timer)
    document.documentElement.toggleAttribute('data-lost', link === 'lost')
    spinner.hidden = link === 'open'
    reset.hidden = link !== 'open'
    bar.hidden = link !== 'starting'
    line.ariaBusy = String(link === 'starting') // a screen reader does not read each step
    if (link === 'open') {
      line.hidden = true
      return
    }
    if (link !== 'starting') setText(text, link === 'connecting' ? 'Connecting to the simulator…' : lost(store))
    if (link !== 'connecting') line.hidden = false
    else timer = window.setTimeout(() => (line.hidden = false), DELAY)
  })
  store.status.watch((status) => {
    if (store.link.value !== 'open' || store.reloadReason.value) return
    line.hidden = !status?.error
    setText(text, sentence(status?.error ?? ''))
  })
  return line
}
