// What buttons show of their requests: that an answer is awaited, and why a request is refused now.
import './pending.css'
import { sentence } from '../actions'
import type { Store } from '../store'

type Control = HTMLButtonElement | HTMLSelectElement

/** Runs an action whose buttons show that it is awaited; while one of them shows this, another press does nothing.
 *
 * The buttons keep the keyboard focus, which a disabled button would lose.
 */
export async function busy(controls: Control | readonly Control[], action: () => Promise<unknown>): Promise<void> {
  const all = controls instanceof Element ? [controls] : controls
  if (all.some((control) => control.ariaBusy === 'true')) return
  const mark = (isBusy: boolean) => {
    for (const control of all) {
      control.ariaBusy = String(isBusy)
      control.ariaDisabled = String(isBusy)
    }
  }
  mark(true)
  try {
    await action()
  } finally {
    mark(false)
  }
}

/** Disables a button while its operation is refused, for example in a replay; its tooltip then says why. */
export function disableWhenRefused(store: Store, control: Control, operation: string): void {
  let usual: string | null = null
  store.refused.watch((refused) => {
    const reason = refused[operation] ?? ''
    control.disabled = reason !== ''
    if (reason) {
      usual ??= control.title
      control.title = sentence(reason)
    } else if (usual !== null) {
      control.title = usual
      usual = null
    }
  })
}
