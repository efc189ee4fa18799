// The tour of the first visit: a small card with one step at a time, which ends when the user has done it.
import type { Observable } from '../observable'
import type { Store } from '../store'
import { type Child, h, setText } from './element'
import { positionNote } from './help'
import { loadPreference, savePreference } from './preferences'

/** Way that the vehicle must drive in the first step [m]. */
const WAY = 1
/** How long the card says that a step is done [ms]. */
const PRAISE = 900

interface Step {
  /** Marks the control of the step: style.css. */
  id: string
  title: string
  keys: Child[]
  /** The text for touch screens. */
  touch: Child[]
  /** Begins the step; returns what says whether it is done, or how far it is. */
  begin: (store: Store) => () => boolean | string
}

const key = (name: string) => h('kbd', {}, name)
const word = (text: string) => h('b', {}, text)

/** The steps with new elements. */
function steps(): Step[] {
  return [
    {
      id: 'drive',
      title: 'Drive a metre',
      keys: ['Hold ', key('{KeyW}'), ' to drive; ', key('{KeyA}'), ' and ', key('{KeyD}'), ' steer.'],
      touch: ['Push the right pad up to drive; the left pad steers.'],
      begin: drive,
    },
    {
      id: 'camera',
      title: 'Look from another camera',
      keys: ['Press ', key('{KeyC}'), ', or the camera in the bar.'],
      touch: ['Press the camera button between the pads, or in the bar.'],
      begin: changed((store) => store.camera.value),
    },
    {
      id: 'rain',
      title: 'Let it rain',
      keys: ['Choose ', word('Heavy rain'), ' in the bar. The road becomes slippery.'],
      touch: ['Choose ', word('Heavy rain'), ' in the bar. The road becomes slippery.'],
      begin: (store) => () => (store.frame.value?.weather?.rain ?? 0) > 0,
    },
    {
      id: 'box',
      title: 'Put a box on the road',
      keys: ['Press ', key('{KeyJ}'), ' (', word('Edit'), '), then ', word('Add box'), '. Drag it where you like.'],
      touch: ['Press ', word('Edit'), ' in the bar, then ', word('Add box'), '. Drag it where you like.'],
      begin: box,
    },
    {
      id: 'drive-on',
      title: 'Drive on',
      keys: ['Press ', word('Done'), ' or ', key('Esc'), ': the keys drive again.'],
      touch: ['Press ', word('Done'), ': the pads drive again.'],
      begin: (store) => () => !store.isEditing.value,
    },
    {
      id: 'record',
      title: 'Record',
      keys: ['Press ', word('Record'), ' in the bar, and drive a little.'],
      touch: ['Press ', word('Record'), ' in the bar or between the pads, and drive a little.'],
      begin: (store) => () => (store.status.value?.recording.state ?? 'off') !== 'off',
    },
    {
      id: 'record',
      title: 'Stop the recording',
      keys: ['Press ', word('Record'), ' again.'],
      touch: ['Press ', word('Record'), ' again.'],
      begin: (store) => () => store.status.value?.recording.state === 'off',
    },
    {
      id: 'replay',
      title: 'Replay it',
      keys: ['Press ', word('Replay'), ' on the card of the recording. The replay opens in a tab of its own.'],
      touch: ['Press ', word('Replay'), ' on the card of the recording. The replay opens in a tab of its own.'],
      begin: pressed('recorded-replay'),
    },
  ]
}

export interface Tour {
  element: HTMLElement
  /** Begins with the first step. */
  start: () => void
}

/** The card; it offers the tour at the first visit. `openPrograms` shows programs that drive the vehicle. */
export function tour(store: Store, openPrograms: () => void): Tour {
  const title = h('h2', { testid: 'tour-title' })
  const count = h('span', { class: 'muted' })
  const text = h('div', { class: 'tour-text', role: 'status', testid: 'tour-text' })
  const progress = h('span', { class: 'tour-progress', testid: 'tour-progress' })
  const buttons = h('div', { class: 'buttons' })
  const element = h(
    'section',
    { class: 'tour', testid: 'tour', 'aria-label': 'Tour', hidden: true },
    h('header', {}, title, count),
    text,
    progress,
    buttons,
  )
  const all = steps()
  let isOffer = loadPreference('tour') === null
  /** The present step; -1: none. */
  let now = -1
  let check: () => boolean | string = () => false
  let timer = 0

  function button(testid: string, label: string, onclick: () => void, isPrimary = false): HTMLElement {
    return h('button', { testid, class: isPrimary && 'primary', onclick }, label)
  }

  function show(heading: string, number: string, content: Child[], controls: HTMLElement[]): void {
    setText(title, heading)
    setText(count, number)
    setText(progress, '')
    text.replaceChildren(...content.filter((child) => child !== null && child !== undefined && child !== false))
    buttons.replaceChildren(...controls)
    element.classList.remove('is-done')
    element.classList.toggle('is-offer', now < 0)
    element.hidden = false
  }

  function offer(): void {
    show(
      'A tour of 60 seconds?',
      '',
      ['Drive, change the camera and the weather, put a box on the road, record and replay.'],
      [button('tour-no', 'Not now', close), button('tour-start', 'Start', start, true)],
    )
  }

  function start(): void {
    isOffer = false
    savePreference('tour', 'seen')
    go(0)
  }

  function go(to: number): void {
    window.clearTimeout(timer)
    timer = 0
    now = to
    const step = all[to]
    if (!step) {
      end()
      return
    }
    document.documentElement.dataset.tour = step.id
    check = step.begin(store)
    const kinds = [h('p', { class: 'keyboard' }, ...step.keys), h('p', { class: 'touch-only' }, ...step.touch)]
    show(
      step.title,
      `${to + 1} of ${all.length}`,
      [...kinds, to === 0 && positionNote()],
      [button('tour-end', 'End the tour', close), button('tour-skip', 'Skip', () => go(now + 1))],
    )
    look()
  }

  function end(): void {
    delete document.documentElement.dataset.tour
    show(
      'That was the tour',
      '',
      [
        h('p', {}, 'Menu has scenarios, weather and tools; HUD has the sensors; Build makes your own town or track.'),
        h('p', {}, 'Help (?) lists all keys, and starts the tour again.'),
      ],
      [
        button('tour-programs', 'Drive it by a program', () => {
          close()
          openPrograms()
        }),
        button('tour-end', 'Close', close, true),
      ],
    )
  }

  function close(): void {
    window.clearTimeout(timer)
    timer = 0
    isOffer = false
    now = -1
    delete document.documentElement.dataset.tour
    savePreference('tour', 'seen')
    element.hidden = true
  }

  /** Goes on when the step is done. */
  function look(): void {
    const isStarted = store.frame.value !== null && store.status.value !== null
    const isReplay = store.status.value?.position != null
    if (isOffer && element.hidden && isStarted && !isReplay) offer()
    if (now < 0 || now >= all.length || timer) return
    const state = check()
    setText(progress, typeof state === 'string' ? state : '')
    if (state !== true) return
    element.classList.add('is-done')
    setText(progress, 'Done')
    timer = window.setTimeout(() => go(now + 1), PRAISE)
  }

  for (const each of [store.frame, store.status, store.camera, store.isEditing])
    (each as Observable<unknown>).watch(look)
  document.addEventListener('click', () => queueMicrotask(look))
  return { element, start }
}

/** The way that the viewed vehicle has driven in Manual mode since the step began. */
function drive(store: Store): () => boolean | string {
  const way = { length: 0, name: '', x: 0, y: 0 }
  return () => {
    const name = store.vehicle.value
    const vehicle = store.frame.value?.vehicles[name]
    if (!vehicle) return false
    if (vehicle.is_autonomous) return 'A program drives: press Autonomous in the bar, then drive.'
    const [x, y] = vehicle.pose.position
    const moved = Math.hypot(x - way.x, y - way.y)
    if (way.name === name && moved < WAY) way.length += moved // a reset moves the vehicle farther
    Object.assign(way, { name, x, y })
    return way.length >= WAY || `${way.length.toFixed(1)} of ${WAY} m`
  }
}

/** Whether a value is another one than at the beginning of the step. */
function changed(read: (store: Store) => unknown): Step['begin'] {
  return (store) => {
    const before = read(store)
    return () => read(store) !== before
  }
}

/** Whether there are more boxes than at the beginning of the step. */
function box(store: Store): () => boolean {
  const boxes = () => Object.keys(store.frame.value?.objects ?? {}).length
  let before = boxes()
  return () => {
    if (boxes() > before) return true
    before = boxes() // another scenario has other boxes
    return false
  }
}

/** Whether a button was pressed since the beginning of the step. */
function pressed(testid: string): Step['begin'] {
  return () => {
    let isPressed = false
    const listen = (event: MouseEvent) => {
      if (!(event.target instanceof Element) || !event.target.closest(`[data-testid='${testid}']`)) return
      isPressed = true
      document.removeEventListener('click', listen, true)
    }
    document.addEventListener('click', listen, true)
    return () => isPressed
  }
}
