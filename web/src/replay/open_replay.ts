// Opens a recording of the simulator in a tab of its own, beside the simulation.
import type { Actions } from '../actions'
import type { Store } from '../store'

/** Shows a recording of the simulator's folder, or the latest one, in a new tab; the simulation goes on. */
export async function openReplay(store: Store, actions: Actions, name = ''): Promise<void> {
  const tab = window.open('', '_blank') // now: a browser opens no tab later than a click
  const port = await actions.textOf({ type: 'ReplayRecording', name })
  if (port === null) {
    tab?.close()
    return
  }
  const url = new URL(location.href)
  url.port = port
  url.hash = ''
  if (tab) tab.location.href = url.href
  else store.warning.value = `The browser has blocked the tab of the replay. Open ${url.href}`
}
