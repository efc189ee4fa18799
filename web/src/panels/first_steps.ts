// Hints for the first visit: how to drive, where the panels are, and how to connect a program.
import { type Child, h } from './element'
import { positionNote } from './help'
import { loadPreference, savePreference } from './preferences'

const key = (name: string) => h('kbd', {}, name)

export function firstSteps(openConnect: () => void, openHelp: () => void): HTMLElement {
  const element = h(
    'section',
    { class: 'hint first-steps', testid: 'hints', 'aria-label': 'First steps' },
    h('h2', {}, 'Welcome'),
    h(
      'dl',
      {},
      ...line(
        'keyboard',
        ['KeyW', 'KeyA', 'KeyS', 'KeyD'].map((code) => key(`{${code}}`)),
        'Drive: hold the keys, or the arrow keys',
      ),
      ...line('touch-only', ['Pads'], 'Drive: steer on the left, throttle on the right'),
      ...line('', [key('{KeyM}'), ' Menu'], 'Camera, light, time, scenario, connection of scripts'),
      ...line('', [key('{KeyU}'), ' HUD'], 'Speed, sensors, camera images, plots'),
      ...line('', [key('?'), ' Help'], 'All keys'),
    ),
    positionNote(),
    h(
      'div',
      { class: 'buttons' },
      h('button', { testid: 'hints-connect', onclick: openConnect }, 'Connect from Python, ROS, C++'),
      h('button', { testid: 'hints-help', onclick: openHelp }, 'Keys'),
      h('button', { class: 'primary', testid: 'hints-close', onclick: () => close() }, 'Got it'),
    ),
  )
  element.hidden = loadPreference('first-steps') === 'seen'

  function close(): void {
    element.hidden = true
    savePreference('first-steps', 'seen')
  }

  window.addEventListener('keydown', (event) => {
    if (event.key === 'Escape' && !element.hidden && !document.querySelector('dialog[open]')) close()
  })
  return element
}

function line(kind: string, name: Child[], text: string): HTMLElement[] {
  return [h('dt', { class: kind }, ...name), h('dd', { class: kind }, text)]
}
