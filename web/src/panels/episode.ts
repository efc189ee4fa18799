// The HUD of an environment: its task and episode, what each car does in it, and how the episodes before have ended.
import type { Episode } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'

/** Height of Bird's Eye above the first car of an environment [m]: all cars of a crossing are then in the image. */
const HEIGHT = 6
/** A smaller gap is none [m]. */
const LEVEL = 0.05

export function episode(store: Store): HTMLElement {
  const title = h('b', { testid: 'episode-title' })
  const cars = h('span', { testid: 'episode-cars' })
  const before = h('span', { class: 'muted', testid: 'episode-before' })
  const element = h(
    'section',
    { class: 'hint episode', testid: 'episode', 'aria-label': 'Episode', hidden: true },
    title,
    cars,
    before,
  )
  let isSeen = false
  store.status.watch((status) => {
    const now = status?.episode ?? null
    element.hidden = now === null
    if (!now) return
    if (!isSeen) lookFromAbove(store)
    isSeen = true
    setText(cars, [carsText(now), gapText(now)].filter(Boolean).join('. '))
    setText(before, now.ended === 0 ? '' : `Before: ${now.succeeded} of ${now.ended} cars succeeded`)
  })
  store.frame.watch((frame) => {
    const now = store.status.value?.episode
    if (frame && now) setText(title, `${words(now.task)}, episode ${now.number}, ${frame.time.toFixed(1)} s`)
  })
  return element
}

/** Shows all cars from above, unless the link has chosen a camera. */
function lookFromAbove(store: Store): void {
  if (store.camera.value !== "Driver's Eye") return
  store.camera.value = "Bird's Eye"
  store.birdHeight.value = HEIGHT
}

/** 'V1 and V3 drive, V2 succeeded'. */
function carsText({ cars }: Episode): string {
  const texts = (['drives', 'succeeded', 'failed'] as const).map((state) => {
    const names = Object.keys(cars).filter((name) => cars[name] === state)
    const verb = state === 'drives' && names.length > 1 ? 'drive' : state
    return names.length > 0 && `${names.join(', ').replace(/, ([^,]*)$/, ' and $1')} ${verb}`
  })
  return texts.filter(Boolean).join(', ')
}

function gapText({ cars, gap }: Episode): string {
  if (gap === null) return ''
  const [first, second] = Object.keys(cars)
  if (Math.abs(gap) < LEVEL) return `${first} and ${second} are level`
  const [ahead, behind] = gap > 0 ? [first, second] : [second, first]
  return `${ahead} is ${Math.abs(gap).toFixed(1)} m ahead of ${behind}`
}

function words(task: string): string {
  const text = task.replaceAll('_', ' ')
  return text.charAt(0).toUpperCase() + text.slice(1)
}
