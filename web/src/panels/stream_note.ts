// Says that the simulator starts to render the view; the page shows its last image until then.
import type { Store } from '../store'
import { h } from './element'

const TEXT = 'The simulator renders this view. Its first image takes some seconds…'

export function streamNote(store: Store): HTMLElement {
  const spinner = h('i', { class: 'spinner' })
  const element = h(
    'div',
    { class: 'hint', testid: 'stream-note', role: 'status', hidden: true },
    spinner,
    h('span', {}, TEXT),
  )
  store.isStreamStarting.watch((isStarting) => (element.hidden = !isStarting))
  return element
}
