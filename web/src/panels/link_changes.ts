// The question before the link of the page changes the simulator: any other page can open such a link without a click.
import type { Store } from '../store'
import { h } from './element'
import { ask } from './question'

/** Proposes a change of the simulator, described in a few words; `apply` makes it if the user agrees. */
export type Propose = (what: string, apply: () => void | Promise<void>) => void

/** Asks once about all that a link would change, as soon as the simulator has sent its state. */
export function askAboutLinkChanges(store: Store): Propose {
  let proposed: Parameters<Propose>[] = []
  let isAsking = false

  async function askOnce(): Promise<void> {
    if (isAsking || proposed.length === 0) return
    isAsking = true
    const asked = proposed
    proposed = []
    if (await mayChange(asked.map(([what]) => what))) for (const [, apply] of asked) void apply()
    isAsking = false
    await askOnce()
  }

  /** After all that is proposed for the same message of the simulator. */
  function askSoon(): void {
    const isReady = store.scene.value && store.frame.value && store.status.value
    if (isReady && proposed.length > 0) window.setTimeout(() => void askOnce())
  }

  store.frame.watch(askSoon)
  return (what, apply) => {
    proposed.push([what, apply])
    askSoon()
  }
}

async function mayChange(changes: readonly string[]): Promise<boolean> {
  const text = 'The link of this page changes the simulator, for all who use it:'
  const list = h('ul', {}, ...changes.map((what) => h('li', {}, what)))
  const content = [h('p', {}, text), list]
  return (await ask('link-changes', 'Change the simulator?', content, [['apply', 'Change it']])) === 'apply'
}
