// Tabs: a row of buttons, each of which shows its panel; arrow keys go to the next one.
import { h } from './element'

export interface Tabs {
  /** The row of buttons. */
  element: HTMLElement
  /** Shows a panel. */
  show: (id: string) => void
}

/** `panels` are [id, label, panel]; `choose` is called when the user selects a tab. */
export function tabs(
  testid: string,
  label: string,
  panels: readonly (readonly [id: string, label: string, panel: HTMLElement])[],
  choose: (id: string) => void = () => {},
): Tabs {
  const buttons = panels.map(([id, text, panel]) => {
    panel.id ||= `${testid}-panel-${id}`
    panel.setAttribute('role', 'tabpanel')
    panel.setAttribute('aria-label', text)
    return h(
      'button',
      {
        ...{ type: 'button', role: 'tab', testid: `${testid}-${id}`, value: id, 'aria-controls': panel.id },
        onclick: () => select(id),
        onkeydown: (event: KeyboardEvent) => key(event, id),
      },
      text,
    )
  })

  function select(id: string): void {
    show(id)
    choose(id)
  }

  function show(id: string): void {
    for (const [i, [other, , panel]] of panels.entries()) {
      buttons[i].setAttribute('aria-selected', String(other === id))
      buttons[i].tabIndex = other === id ? 0 : -1
      panel.hidden = other !== id
    }
  }

  function key(event: KeyboardEvent, id: string): void {
    const shown = buttons.filter((button) => button.checkVisibility?.() ?? !button.hidden)
    const now = shown.findIndex((button) => button.value === id)
    const steps = { ArrowRight: now + 1, ArrowLeft: now - 1, Home: 0, End: -1 }
    if (!(event.key in steps)) return
    event.preventDefault()
    event.stopPropagation() // arrow keys drive, too
    const next = shown.at(steps[event.key as keyof typeof steps] % shown.length)
    if (next) select(next.value)
    next?.focus()
  }

  if (panels[0]) show(panels[0][0])
  return { element: h('div', { class: 'tabs', role: 'tablist', 'aria-label': label, testid }, ...buttons), show }
}
