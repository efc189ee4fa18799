// What is wrong with the map in Build mode: errors with their repairs, open ends, and advice.
import type { Builder } from '../building/builder'
import { wrapped } from '../building/fitting'
import { words } from '../building/part_names'
import type { MapProblem, MapScene } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { errorCount, section } from './fields'
import { busy } from './pending'
import type { VehicleEvents } from './vehicle_events'

const DEGREE = Math.PI / 180
/** A vehicle that has moved farther is elsewhere [m]. */
const NEAR = 0.05

/** What is wrong with the map, with the place and, where it is known, the repair; then its open ends, and advice. */
export function problems(store: Store, builder: Builder, vehicleEvents: VehicleEvents): HTMLElement {
  const errors = h('ul', { class: 'problems', testid: 'build-problems' })
  const advice = h('ul', { class: 'problems', testid: 'build-advice' })
  const ends = openEnds(store, builder)
  const element = section('No errors', errors, ends, advice)
  element.classList.add('checks')
  const heading = element.querySelector('h2')
  /** Whether a vehicle of the advice is still off the road: it stands where it stood, or has not come back. */
  const isTrue = ({ kind, x, y, vehicle }: MapProblem): boolean => {
    if (kind !== 'outside') return true
    const at = store.frame.value?.vehicles[vehicle]?.pose.position
    return !!at && (Math.hypot(at[0] - x, at[1] - y) < NEAR || vehicleEvents.isOffRoad(vehicle))
  }
  const itemOf = (problem: MapProblem): HTMLElement => {
    const show = h('button', { onclick: () => builder.show(problem) }, 'Show me')
    const repair = h('button', { onclick: () => void busy(repair, () => builder.repair(problem)) }, 'Repair')
    const isKnown = Object.keys(problem.repair).length > 0
    const { place, vehicle } = problem
    const onPut = (): void => void (put && place && busy(put, () => builder.placeAt(vehicle, place)))
    const put = place && h('button', { onclick: onPut }, `Put ${vehicle} on the nearest road`)
    const row = h('div', { class: 'row' }, show, isKnown && repair, put)
    const item = h('li', {}, h('span', {}, problemText(problem, builder.scene?.parts ?? {})), row)
    item.dataset.kind = problem.kind
    return item
  }
  let shown: readonly MapProblem[] | null = null
  const show = (): void => {
    const map = store.scene.value?.map_scene
    const wrong = (map?.problems ?? []).filter(({ kind }) => kind !== 'unconnected')
    const hints = (map?.advice ?? []).filter(isTrue)
    const all = [...wrong, ...hints]
    if (all.length === shown?.length && all.every((one, i) => one === shown?.[i])) return
    shown = all
    if (heading) setText(heading, errorCount(wrong.length))
    element.toggleAttribute('data-wrong', wrong.length > 0)
    errors.replaceChildren(...wrong.map(itemOf))
    advice.replaceChildren(...hints.map(itemOf))
  }
  store.scene.watch(show)
  store.status.watch(show)
  return element
}

/** How many ends of roads are open, and what can be done with all of them. */
function openEnds(store: Store, builder: Builder): HTMLElement {
  const text = h('span', { testid: 'build-ends-state', role: 'status' })
  const close = h(
    'button',
    { testid: 'build-close-all', onclick: () => void busy(close, () => builder.closeAll()) },
    'Close all',
  )
  const next = h('button', { testid: 'build-next-end', onclick: () => builder.nextPort() }, 'Show me')
  const leave = h(
    'button',
    { testid: 'build-leave-open', onclick: () => void busy(leave, () => builder.leaveOpen()) },
    'Leave open',
  )
  close.title = 'Add roads from end to end; an end that no road reaches gets a dead end'
  next.title = 'Go to the next open end, where a piece can be set ({KeyN})'
  leave.title = 'The road may end there'
  const element = h(
    'div',
    { class: 'open-ends', testid: 'build-ends' },
    text,
    h('div', { class: 'row' }, close, next, leave),
  )
  store.scene.watch(() => {
    const count = builder.openEnds.length
    element.hidden = count === 0
    setText(text, count === 1 ? '1 open end' : `${count} open ends`)
  })
  return element
}

/** A problem of the map in words. */
function problemText({ kind, text, parts: names, repair }: MapProblem, parts: MapScene['parts']): string {
  const [a, b = ''] = names.map(words)
  const [before, after] = [parts[names[1]], repair[names[1]]]
  const isKnown = before && before.type !== 'MapWall' && after && after.type !== 'MapWall'
  const gap = isKnown ? Math.hypot(after.x - before.x, after.y - before.y) : 0
  const turn = isKnown ? Math.abs(wrapped(after.yaw - before.yaw)) / DEGREE : 0
  switch (kind) {
    case 'apart':
      return `${a} and ${b} do not meet: ${(100 * gap).toPrecision(2)} cm are between their ends.`
    case 'turned':
      return `${b} does not go straight on from ${a}: it is turned by ${turn.toPrecision(2)}°.`
    case 'width':
      return `${a} and ${b} do not fit together: ${/lanes/.test(text) ? 'they have different numbers of lanes' : 'one road is wider'}.`
    case 'overlap':
    case 'solids':
      return b ? `${a} lies on ${b}. Move one of them.` : shortened(text)
    case 'blocked':
      return `${a} stands on a lane of ${b}. Move it.`
    default:
      return shortened(text)
  }
}

/** The problem without its place in a file. */
function shortened(text: string): string {
  return text.replace(/^placement \d+ '(.+?)': /, '$1: ').replace(/placement \d+ (?=')/g, '')
}
