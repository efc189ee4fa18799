// The start screen: six cards, and below them all scenarios. While the simulator starts, a chosen card waits for it.
import '../start.css'

import type { Actions } from '../actions'
import { Observable } from '../observable'
import { openReplay } from '../replay/open_replay'
import type { Scenarios } from '../scenarios'
import { sceneUrl } from '../scene/assets'
import { stillOf } from '../stills'
import type { Store } from '../store'
import { h, setText } from './element'

/** A card: what it is called, one line about it, and the scenario that it enters; '' for that of the picture alone. */
interface Card {
  id: string
  title: string
  line: string
  still: string
  scenario: string
  builds?: true
}

const CARDS: readonly Card[] = [
  driving('town', 'Drive the town', 'Twelve other cars, traffic lights and signs', 'traffic'),
  driving('rain', 'Traffic in the rain', 'Wet roads, less grip, lamps and spray', 'traffic_rain'),
  driving('race', 'Race', 'A fast car on a race track, with lap times', 'practice'),
  driving('park', 'Park', 'A free bay between parked cars', 'parking'),
  {
    ...{ id: 'build', title: 'Build your own', line: 'Make roads or a race track, then drive on them' },
    ...{ still: 'build', scenario: 'plane', builds: true },
  },
  {
    ...{ id: 'open', title: 'Open a file', line: 'A recording, a scenario, a map, a track, or its picture' },
    ...{ still: 'night', scenario: '' },
  },
]

function driving(id: string, title: string, line: string, scenario: string): Card {
  return { id, title, line, still: scenario, scenario }
}

/** What was chosen, until its first image: its title, the name of its still, and what enters it. */
interface Entry {
  title: string
  still: string
  enter: () => Promise<boolean>
}

/** `openFiles` opens files of the user; `banner` is shown in the screen while it is open. */
export function start(
  store: Store,
  actions: Actions,
  scenarios: Scenarios,
  openFiles: (files: readonly File[]) => Promise<void>,
  banner: HTMLElement,
): HTMLElement[] {
  // a link that names a part of the view, a map or the weather shows that, and not the start screen
  const namesSomething = location.hash.length > 1
  const chosen = new Observable<Entry | null>(null)
  const isReady = () => store.link.value === 'open'
  const file = h('input', {
    ...{ type: 'file', multiple: true, accept: '.mcap,.yaml,.yml,.png,.pgm', hidden: true, testid: 'start-file' },
    onchange: () => {
      const files = [...(file.files ?? [])]
      file.value = ''
      const [first] = files
      if (!first) return
      const open = () => (/\.mcap$/i.test(first.name) ? openReplay(store, actions, first.name) : openFiles(files))
      choose({ title: first.name, still: '', enter: () => open().then(() => true) })
    },
  })
  const close = h('button', { testid: 'start-close', title: 'Close (Esc)', onclick: () => hide() }, 'Close')
  const cards = CARDS.map((card) =>
    cardOf(
      card,
      () => (card.scenario ? choose(entryOf(card)) : file.click()),
      () => choose(entryOf(card, true)),
    ),
  )
  const list = h('ul', { class: 'all', testid: 'start-scenarios' })
  const all = h('section', { class: 'plate' }, h('h3', { id: 'start-all' }, 'All scenarios'), list)
  const slot = h('div', { class: 'slot' })
  const dialog = h(
    'dialog',
    { class: 'start', id: 'start', testid: 'start', 'aria-labelledby': 'start-title', onclose: () => hide() },
    h('header', { class: 'plate' }, h('h2', { id: 'start-title' }, 'What do you want to do?'), close),
    slot,
    h('ul', { class: 'cards' }, ...cards),
    all,
    file,
  )
  let home: HTMLElement | null = null
  let isOffered = false

  /** `isWatched`: the driver of the simulator drives, until the user takes the wheel. */
  function entryOf({ title, still, scenario, builds }: Card, isWatched = false): Entry {
    return {
      ...{ title, still },
      enter: async () => {
        if (!(await load(scenario))) return false
        store.isBuilding.value = builds ?? false
        const vehicle = store.vehicle.value
        if (isWatched && (await actions.request({ type: 'LetDrive', vehicle }))) store.watched.value = vehicle
        return true
      },
    }
  }

  /** Loads a scenario, and shows it as the AutoDRIVE Simulator shows its own at the start. */
  async function load(name: string): Promise<boolean> {
    store.isEditing.value = store.isBuilding.value = false
    store.watched.value = ''
    if (!(await scenarios.choose(name))) {
      if (scenarios.error.value) store.error.value = scenarios.error.value
      return false
    }
    store.camera.value = "Driver's Eye"
    store.vehicle.value = Object.keys(store.scene.value?.vehicles ?? {})[0] ?? ''
    if (store.status.value?.is_paused) await actions.request({ type: 'Resume' })
    return true
  }

  function choose(entry: Entry): void {
    chosen.value = entry
    hide()
    if (isReady()) void enter()
  }

  async function enter(): Promise<void> {
    await chosen.value?.enter()
    chosen.value = null
  }

  function hide(): void {
    store.isStartOpen.value = store.isTurning.value = false
  }

  function offer(isWanted = false): void {
    if (!isWanted || isOffered || namesSomething) return
    isOffered = true
    store.isTurning.value = store.isStartOpen.value = true
  }

  function showList(): void {
    const present = store.scene.value?.scenario
    const titles = Object.entries(store.welcome.value ? scenarios.titles : {})
    all.hidden = titles.length === 0
    list.replaceChildren(
      ...titles.map(([name, title]) => {
        const entry = { title, still: name, enter: () => load(name) }
        const attributes = { testid: `start-scenario-${name}`, 'aria-current': name === present && 'true' }
        return h('li', {}, h('button', { ...attributes, onclick: () => choose(entry) }, picture(name), title))
      }),
    )
  }

  dialog.addEventListener('keydown', (event) => moveFocus(dialog, event))
  store.isStartOpen.watch((isOpen) => {
    if (isOpen && !dialog.open) {
      showList()
      home = banner.parentElement
      slot.append(banner)
      dialog.showModal()
      cards[0].querySelector('button')?.focus()
    } else if (!isOpen) {
      home?.prepend(banner)
      dialog.close()
    }
  })
  for (const one of [store.welcome, store.files, store.scene]) one.watch(() => dialog.open && showList())
  store.starting.watch((starting) => offer(starting?.has_start_screen))
  store.welcome.watch((welcome) => offer(welcome?.has_start_screen))
  store.link.watch((link) => {
    if (link === 'open' && chosen.value) void enter()
  })
  return [stillPicture(store, scenarios, chosen), dialog]
}

function cardOf(
  { id, title, line, still, builds, scenario }: Card,
  choose: () => void,
  watch: () => void,
): HTMLElement {
  const isDriven = scenario !== '' && !builds
  const label = { 'aria-label': `Watch: ${title}`, title: 'The simulator drives until you take the wheel' }
  return h(
    'li',
    { class: 'card' },
    h('button', { testid: `start-${id}`, onclick: choose }, picture(still), h('b', {}, title), h('span', {}, line)),
    isDriven && h('button', { class: 'watches', testid: `start-${id}-watch`, onclick: watch, ...label }, 'Watch'),
  )
}

/** The picture of a scenario, or an empty place. */
function picture(name: string): HTMLElement {
  const address = stillOf(name)
  return address ? h('img', { src: address, alt: '', width: 640, height: 360 }) : h('i', { class: 'no-still' })
}

/** Moves the focus to the next button in the direction of an arrow key. */
function moveFocus(dialog: HTMLElement, event: KeyboardEvent): void {
  const [across, down] = ARROWS[event.key] ?? [0, 0]
  const from = document.activeElement
  const buttons = [...dialog.querySelectorAll<HTMLElement>('li button:not(.watches)')]
  if ((!across && !down) || !(from instanceof HTMLElement) || !buttons.includes(from)) return
  event.preventDefault()
  if (across) {
    buttons[buttons.indexOf(from) + across]?.focus()
    return
  }
  const here = middle(from)
  const ahead = buttons.filter((button) => down * (middle(button).y - here.y) > 0.5 * button.offsetHeight)
  const distance = (button: HTMLElement) =>
    3 * Math.abs(middle(button).y - here.y) + Math.abs(middle(button).x - here.x)
  ahead.sort((a, b) => distance(a) - distance(b))[0]?.focus()
}

const ARROWS: Record<string, readonly [across: number, down: number]> = {
  ...{ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] },
}

function middle(element: HTMLElement): { x: number; y: number } {
  const { left, top, width, height } = element.getBoundingClientRect()
  return { x: left + 0.5 * width, y: top + 0.5 * height }
}

/** Fills the page until the first image of a scenario: its still picture or else its floor plan, and what is loaded. */
function stillPicture(store: Store, scenarios: Scenarios, chosen: Observable<Entry | null>): HTMLElement {
  const text = h('p', { class: 'plate', role: 'status', testid: 'still-text' })
  const element = h('div', { class: 'still', testid: 'still' }, text)
  const show = () => {
    const scene = store.scene.value
    const isDrawn = scene !== null && store.shownScene.value?.scenario === scene.scenario
    const waiting = chosen.value
    const name = waiting?.still || scenarios.loading.value
    const shown = name || (isDrawn ? '' : (scene?.scenario ?? store.starting.value?.scenario ?? ''))
    const plan = scene?.scenario === shown && scene.plan ? sceneUrl(scene.plan.image).href : null
    const address = shown ? (stillOf(shown) ?? plan) : null
    element.hidden = !address
    element.classList.toggle('is-plan', address !== null && address === plan)
    if (address && element.dataset.name !== shown) element.style.backgroundImage = `url("${address}")`
    element.dataset.name = shown
    const title = waiting?.title ?? scenarios.titles[scenarios.loading.value] ?? (scene && shown ? scene.title : '')
    const amount =
      scene?.scenario === shown && store.sceneBytes.value > 0 ? ` ${megabytes(store.sceneBytes.value)}` : ''
    setText(text, title ? (store.link.value === 'open' ? `Loading ${title}…${amount}` : `${title} follows…`) : '')
    text.hidden = !title
  }
  const { scene, shownScene, starting, link, sceneBytes } = store
  for (const one of [scene, shownScene, starting, link, sceneBytes, scenarios.loading, chosen])
    (one as Observable<unknown>).watch(show)
  return element
}

function megabytes(bytes: number): string {
  return `${(bytes / 1e6).toFixed(1)} MB`
}
