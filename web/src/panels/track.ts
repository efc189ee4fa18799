// The race track in the panel of Build mode: a new or a random one, its width and barrier, its points and its faults.
import type { TrackBuilder } from '../building/track_builder'
import { faultText, shapeOf } from '../building/track_line'
import type { TrackLine } from '../messages'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { numberField } from './edit'
import { h, setText } from './element'
import { choice, errorCount, labelled, section, setOptions } from './fields'
import { busy } from './pending'

/** Length, width and barrier of the track, and the selected point. */
export function shape(store: Store, builder: TrackBuilder): HTMLElement {
  const state = h('p', { testid: 'track-state', role: 'status' })
  const width = numberField('track-width', {
    ...{ step: 0.1, min: 0.2, max: 50 },
    onchange: () => void builder.setValues({ width: Number(width.value) }).then(show),
  })
  const barrier = choice('track-barrier', (kind) => void builder.setValues({ barrier: kind as TrackLine['barrier'] }), {
    'aria-label': 'Barrier',
  })
  setOptions(barrier, { wall: 'Wall', duct: 'Air ducts' })
  const hint =
    'Drag a point. Click the line to add a point. Keys: N next point, arrows move it, Enter adds one, Delete removes it.'

  function show(): void {
    const { line, scene } = builder
    if (!line) return
    const index = builder.selected.value
    const own = scene?.is_exact === false ? ' It has walls of its own; a change replaces them.' : ''
    const point = index < 0 ? '' : `Point ${index + 1} of `
    setText(state, `${point}${line.points.length} points, ${shapeOf(line).length.toFixed(1)} m.${own}`)
    if (document.activeElement !== width) width.value = String(line.width)
    barrier.value = line.barrier
  }

  store.scene.watch(show)
  builder.selected.watch(show)
  builder.draft.watch(show)
  return section(
    'Race track',
    state,
    labelled('Width [m]', width),
    labelled('Barrier', barrier),
    h('p', { class: 'edit-hint' }, hint),
  )
}

/** What is wrong with the track that is shown, also while a point is dragged. */
export function faults(store: Store, builder: TrackBuilder, view: () => SceneView | null): HTMLElement {
  const list = h('ul', { class: 'problems', testid: 'track-problems' })
  const element = section('', list)
  element.classList.add('checks')
  const heading = element.querySelector('h2')

  function show(): void {
    const { line } = builder
    const found = line ? shapeOf(line).faults : []
    // a hidden heading must not be found as the one of the modules
    if (heading) setText(heading, line ? errorCount(found.length) : '')
    element.toggleAttribute('data-wrong', found.length > 0)
    list.replaceChildren(
      ...found.map((fault) => {
        const look = (): void => {
          builder.selected.value = fault.point
          view()?.lookAt(...fault.at)
        }
        const row = h('div', { class: 'row' }, h('button', { onclick: look }, 'Show me'))
        const item = h('li', {}, h('span', {}, faultText(fault)), row)
        item.dataset.kind = fault.kind
        return item
      }),
    )
  }

  store.scene.watch(show)
  builder.draft.watch(show)
  return element
}

/** A random track for a seed and a length. */
export function randomTrack(store: Store, builder: TrackBuilder, mayReplace: () => Promise<boolean>): HTMLElement {
  const seed = numberField('track-seed', { step: 1, min: 0, value: 1 })
  const length = numberField('track-length', { step: 5, min: 15, max: 100, value: 60 })
  const random = async (): Promise<void> => {
    const width = Math.min(Math.max(builder.line?.width ?? 1.2, 0.9), 3)
    const isRandom = store.status.value?.undo.startsWith('use the random track') // it can be made again
    if (!isRandom && !(await mayReplace())) return
    if (await builder.generate(Number(seed.value), Number(length.value), width)) builder.showAll()
  }
  const button = h('button', { testid: 'track-random', onclick: () => void busy(button, random) }, 'Random track')
  return section(
    'Random track',
    labelled('Seed', seed),
    labelled('Length [m]', length),
    h('div', { class: 'row' }, button),
  )
}
