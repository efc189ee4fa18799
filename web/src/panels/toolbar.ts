// The bar on top: Menu, title, how the simulation runs, help, HUD.
import type { Store } from '../store'
import type { Signal } from '../signal'
import { banner } from './banner'
import { h, icon, setText } from './element'
import { HUD, MENU } from './icons'

export function toolbar(store: Store, showHelp: () => void): HTMLElement {
  const words = { 'aria-label': 'Help', title: 'Keys and controls (?)' }
  return h(
    'header',
    { class: 'toolbar' },
    opener('menu', 'Menu', MENU, 'M', store.isMenuOpen),
    h('h1', { testid: 'title' }, 'AutoDRIVE Simulator'),
    banner(store),
    run(store),
    h('button', { class: 'round', testid: 'help', onclick: showHelp, ...words }, '?'),
    opener('hud', 'HUD', HUD, 'U', store.isHudOpen),
  )
}

/** The button that shows and hides a panel. */
function opener(id: string, label: string, path: string, key: string, isOpen: Signal<boolean>): HTMLElement {
  const button = h(
    'button',
    {
      testid: `${id}-button`,
      'aria-controls': id,
      title: `${label} (${key})`,
      onclick: () => (isOpen.value = !isOpen.value),
    },
    icon(path),
    label,
  )
  isOpen.watch((value) => button.setAttribute('aria-expanded', String(value)))
  return button
}

/** Whether simulated time runs, and how fast. */
function run(store: Store): HTMLElement {
  const factor = h('output', { testid: 'real-time-factor' })
  const running = h('span', { title: 'Simulated seconds per second that were reached' }, 'Real time ', factor)
  const paused = h('b', { testid: 'paused' }, 'Paused')
  store.status.watch((status) => {
    running.hidden = !status || status.is_paused
    paused.hidden = !status?.is_paused
    setText(factor, `${status?.real_time_factor.toFixed(2)} ×`)
  })
  return h('div', { class: 'run' }, running, paused)
}
