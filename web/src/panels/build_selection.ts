// The card of the selected part in Build mode: its picture, name, pose and sizes, and what can be done with it.
import type { Builder } from '../building/builder'
import { words } from '../building/part_names'
import type { MapModule, MapPart, MapScene } from '../messages'
import { sceneUrl } from '../scene/assets'
import type { Store } from '../store'
import { faceOf, solidPicture } from './build_pieces'
import { numberField } from './edit'
import { h, setText } from './element'
import { labelled, section } from './fields'
import { busy } from './pending'

const DEGREE = Math.PI / 180

/** The card; hidden while nothing is selected. */
export function selection(store: Store, builder: Builder): HTMLElement {
  const picture = h('img', { alt: '' })
  const name = h('b', { testid: 'build-selected', role: 'status' })
  const kind = h('span', { class: 'kind' })
  const fields = {
    x: numberField('build-x', { step: 0.05, onchange: () => void move() }),
    y: numberField('build-y', { step: 0.05, onchange: () => void move() }),
    yaw: numberField('build-yaw', { step: 15, onchange: () => void move() }),
    length: numberField('build-length', { step: 0.1, min: 0.01, onchange: () => void size() }),
    width: numberField('build-width', { step: 0.1, min: 0.01, onchange: () => void size() }),
  }
  const isOpen = h('input', { type: 'checkbox', testid: 'build-open', role: 'switch' })
  isOpen.addEventListener('change', () => void builder.setValues({ open: isOpen.checked }))
  const pose = h(
    'div',
    { class: 'fields' },
    named('x [m]', fields.x),
    named('y [m]', fields.y),
    named('Heading [°]', fields.yaw),
  )
  const sizes = h('div', { class: 'fields' }, named('Length [m]', fields.length), named('Width [m]', fields.width))
  const open = labelled('Ends may stay open', isOpen)
  const car = h('button', { testid: 'build-car', onclick: () => void busy(car, () => builder.placeVehicle()) })
  store.vehicle.watch((vehicle) => setText(car, `Put ${vehicle || 'the vehicle'} here`))
  const title = h('div', {}, name, kind)
  const others = h('div', { class: 'replacements', testid: 'build-replace', role: 'group', 'aria-label': 'Replace by' })
  const heading = h('div', { class: 'part' }, picture, title)
  const element = section('Selected', heading, pose, sizes, open, others, car)
  element.classList.add('selected-card')

  async function move(): Promise<void> {
    const [x, y, yaw] = [fields.x, fields.y, fields.yaw].map((field) => Number(field.value))
    await builder.setValues({ x, y, yaw: yaw * DEGREE })
    show()
  }

  async function size(): Promise<void> {
    await builder.setValues({ length: Number(fields.length.value), width: Number(fields.width.value) })
    show()
  }

  function show(): void {
    const { part, scene } = builder
    const names = builder.selected.value
    element.hidden = names.length === 0
    for (const row of [pose, sizes, open, others, car]) row.hidden = !part
    picture.hidden = !part
    if (!part || !scene) {
      setText(name, `${names.length} pieces`)
      setText(kind, 'Move, turn, copy or delete them together')
      return
    }
    const module = part.type === 'MapModule' ? builder.module(part) : undefined
    const image = pictureOf(part, scene)
    if (picture.src !== image) picture.src = image
    setText(name, names[0])
    setText(kind, titleOf(part, scene))
    showReplacements(scene)
    const isSized = part.type === 'MapBlock' || module?.type === 'terrain' || module?.type === 'obstruction'
    pose.hidden = part.type === 'MapWall'
    sizes.hidden = !isSized
    car.hidden = open.hidden = !module || Object.keys(module.ports).length === 0
    if (part.type === 'MapWall') return
    const sized = part as Pick<MapModule, 'length' | 'width'>
    const values = { x: part.x, y: part.y, yaw: part.yaw / DEGREE, length: 0, width: 0 }
    if (isSized) {
      values.length = sized.length ?? module?.length ?? 0
      values.width = sized.width ?? module?.width ?? 0
    }
    for (const [key, field] of Object.entries(fields)) {
      const text = String(Math.round(1000 * values[key as keyof typeof values]) / 1000)
      if (field.value !== text) field.value = text
    }
    isOpen.checked = part.type === 'MapModule' && part.open === true
  }

  /** Pictures of the modules that have the same ends as the selected one. */
  function showReplacements(scene: MapScene): void {
    const found = builder.replacements
    others.hidden = found.length === 0
    const key = JSON.stringify(found)
    if (others.dataset.shown === key) return
    others.dataset.shown = key
    const buttons = found.map(({ module, pose }) => {
      const { title, image } = scene.modules[module]
      const onclick = (): void => void busy(button, () => builder.replace(module, pose))
      const drawing = h('img', { src: sceneUrl(image).href, alt: title })
      const button = h('button', { title: `Replace by ${title}: it has the same ends`, onclick }, drawing)
      button.dataset.module = module
      return button
    })
    others.replaceChildren(h('span', {}, 'Replace by'), ...buttons)
  }

  builder.selected.watch(show)
  store.scene.watch(show)
  return element
}

/** A field with its name above it. */
function named(label: string, field: HTMLElement): HTMLElement {
  return h('label', {}, h('span', {}, label), field)
}

function pictureOf(part: MapPart, scene: MapScene): string {
  if (part.type === 'MapProp') return faceOf(scene, part.kind)
  if (part.type !== 'MapModule') return solidPicture(part.type === 'MapWall' ? 'wall' : 'block')
  const image = scene.modules[part.module]?.image
  return image ? sceneUrl(image).href : ''
}

function titleOf(part: MapPart, scene: MapScene): string {
  if (part.type === 'MapProp') return words(part.kind)
  if (part.type === 'MapModule') return scene.modules[part.module]?.title ?? ''
  return part.type === 'MapWall' ? 'Wall' : 'Block'
}
