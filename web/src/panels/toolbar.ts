// The toolbar: Menu, title, state of the simulation, help, HUD.

import type { Observable } from '../observable'
import type { Store } from '../store'
import { h, icon, setText } from './element'
import { BUILD, EDIT, HUD, MENU } from './icons'
import { disableWhenRefused } from './pending'

export function toolbar(store: Store, showHelp: () => void): HTMLElement {
  const label = { 'aria-label': 'Help', title: 'Keys and controls (?)' }
  return h(
    'header',
    { class: 'toolbar' },
    opener('menu', 'Menu', MENU, 'KeyM', store.isMenuOpen),
    h('h1', { testid: 'title' }, 'AutoDRIVE Simulator'),
    run(store),
    mode(store, opener('edit', 'Edit', EDIT, 'KeyJ', store.isEditing), 'Place'),
    mode(store, opener('build', 'Build', BUILD, 'KeyZ', store.isBuilding), 'UseMap'),
    h('button', { class: 'round', testid: 'help', onclick: showHelp, ...label }, '?'),
    opener('hud', 'HUD', HUD, 'KeyU', store.isHudOpen),
  )
}

/** The button of a mode, which cannot be used where its edits are refused. */
function mode(store: Store, button: HTMLButtonElement, operation: string): HTMLButtonElement {
  disableWhenRefused(store, button, operation)
  return button
}

/** A button that shows and hides a panel. */
function opener(id: string, label: string, path: string, code: string, isOpen: Observable<boolean>): HTMLButtonElement {
  const button = h(
    'button',
    {
      testid: `${id}-button`,
      'aria-controls': id,
      'aria-label': label,
      title: `${label} ({${code}})`,
      onclick: () => (isOpen.value = !isOpen.value),
    },
    icon(path),
    h('span', {}, label),
  )
  isOpen.watch((value) => button.setAttribute('aria-expanded', String(value)))
  return button
}

/** Real-time factor, or "Paused". */
function run(store: Store): HTMLElement {
  const factor = h('output', { testid: 'real-time-factor' })
  const label = h('span', { class: 'run-label' }, 'Real time ')
  const running = h('span', { title: 'Simulated seconds per second of wall time (measured)' }, label, factor)
  const paused = h('b', { testid: 'paused' }, 'Paused')
  store.status.watch((status) => {
    running.hidden = !status || status.is_paused
    paused.hidden = !status?.is_paused
    setText(factor, `${status?.real_time_factor.toFixed(2)} ×`)
  })
  return h('div', { class: 'run' }, running, paused)
}
