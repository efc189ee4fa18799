// The legend of what is drawn over the scene: collision shapes, contact forces, axes.
import type { Connection } from '../connection'
import type { Observable } from '../observable'
import { ARROW, OVERLAY_COLOURS } from '../scene/overlay_look'
import type { Store } from '../store'
import { h, setText } from './element'
import { rangeScale } from './range_scale'
import { scaleFor } from './scales'

type Tint = readonly number[]

/** The card with the legend; it also asks the simulator for what is shown. */
export function legend(store: Store, connection: Connection): HTMLElement {
  const { areShapesShown, areForcesShown, areAxesShown } = store
  const scale = h('span', { testid: 'force-scale' })
  const { vehicle, object, fixed, wheel, body, axes } = OVERLAY_COLOURS
  const parts: [Observable<boolean>, HTMLElement][] = [
    [areShapesShown, part('Collision shapes', [vehicle, 'vehicle'], [object, 'movable'], [fixed, 'fixed, within 3 m'])],
    [areForcesShown, part('Contact forces', [wheel, 'on a wheel'], [body, 'on the body'])],
    [areAxesShown, part('Axes', [axes[0], 'x ahead'], [axes[1], 'y left'], [axes[2], 'z up'])],
  ]
  parts[1][1].append(scale)
  const lidar = h('div', {}, h('h2', {}, 'LIDAR range'), rangeScale('LIDAR range', store.scanFarthest))
  const element = h(
    'section',
    { class: 'card legend', testid: 'legend', 'aria-label': 'Legend', hidden: true },
    ...parts.map(([, of]) => of),
    lidar,
  )

  function show(): void {
    for (const [is, of] of parts) of.hidden = !is.value
    lidar.hidden = !store.isScanShown.value || store.quality.value === 'stream'
    element.hidden = parts.every(([is]) => !is.value)
  }

  let asked = ''
  function ask(): void {
    const wanted = { shapes: areShapesShown.value || areAxesShown.value, contacts: areForcesShown.value }
    if (asked !== JSON.stringify(wanted) && (asked || wanted.shapes || wanted.contacts)) connection.subscribe(wanted)
    asked = JSON.stringify(wanted)
    show()
  }

  for (const [is] of parts) is.watch(ask)
  store.quality.watch(show)
  store.isScanShown.watch(show)
  store.contacts.watch((vehicles) => {
    for (const { force } of Object.values(vehicles)) store.forceScale.value ||= scaleFor(force)
  })
  store.forceScale.watch((force) => {
    setText(scale, force ? `an arrow of ${Math.round(100 * ARROW)} cm is ${force} N` : 'no forces yet')
  })
  return element
}

function part(title: string, ...colours: [Tint, string][]): HTMLElement {
  const rows = colours.map(([tint, name]) =>
    h('li', {}, h('i', { style: `background: rgb(${tint.slice(0, 3).map((one) => Math.round(255 * one))})` }), name),
  )
  return h('div', {}, h('h2', {}, title), h('ul', {}, ...rows))
}
