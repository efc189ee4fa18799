// Edit mode: its bar of buttons, and the panel with the selected thing, the next box and the sensors.

import type { Editor } from '../editing/editor'
import { Observable } from '../observable'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { h, icon, setText } from './element'
import { choice, labelled, section, setOptions } from './fields'
import { ADD, DETAILS, REDO, REMOVE, SAVE, TURN_LEFT, TURN_RIGHT, UNDO } from './icons'
import { busy } from './pending'
import { sensors } from './sensors'

const DEGREE = Math.PI / 180
/** Step of the turn buttons [rad]. */
const TURN = 15 * DEGREE
/** In a window of this width [CSS pixels] the panel would cover the scene; a button opens it. */
const NARROW = 719

/** The bar and the panel; they are shown in Edit mode. */
export function edit(
  store: Store,
  editor: Editor,
  view: () => SceneView | null,
  save: () => Promise<boolean>,
): HTMLElement[] {
  const isPanelOpen = new Observable(innerWidth > NARROW)
  const [buttons, details] = [bar(store, editor, view, isPanelOpen, save), panel(store, editor)]
  const show = (): void => {
    buttons.hidden = !store.isEditing.value
    details.hidden = !store.isEditing.value || !isPanelOpen.value
    document.documentElement.toggleAttribute('data-editing', store.isMapViewed)
  }
  // the panels end above the bar
  new ResizeObserver(() => {
    if (store.isEditing.value) document.documentElement.style.setProperty('--edit-bar', `${buttons.offsetHeight}px`)
  }).observe(buttons)
  isPanelOpen.watch(show)
  store.isEditing.watch((isEditing) => {
    show()
    if (isEditing) store.isMenuOpen.value = false
  })
  return [buttons, details]
}

function bar(
  store: Store,
  editor: Editor,
  view: () => SceneView | null,
  isPanelOpen: Observable<boolean>,
  save: () => Promise<boolean>,
): HTMLElement {
  const turn = (angle: number) => {
    editor.shift(0, 0, angle)
    void editor.commit()
  }
  const add = () => {
    const at = view()?.groundPoint(0.5 * innerWidth, 0.5 * innerHeight) ?? [0, 0]
    void busy(buttons.add, () => editor.addBox(at[0], at[1]))
  }
  const buttons = {
    add: barButton('edit-add', 'Add box', ADD, 'Add a box in the middle of the view', add),
    remove: barButton('edit-remove', 'Delete', REMOVE, 'Delete the selected box (Delete)', () => void editor.remove()),
    left: barButton('edit-left', 'Turn left', TURN_LEFT, 'Turn left by 15° ([)', () => turn(TURN), true),
    right: barButton('edit-right', 'Turn right', TURN_RIGHT, 'Turn right by 15° (])', () => turn(-TURN), true),
    undo: barButton('edit-undo', 'Undo', UNDO, '', () => void busy(buttons.undo, () => editor.undo())),
    redo: barButton('edit-redo', 'Redo', REDO, '', () => void busy(buttons.redo, () => editor.redo())),
    save: barButton('edit-save', 'Save as scenario', SAVE, 'Download the scenario as a YAML file', () => void save()),
    details: barButton(
      'edit-details',
      'Panel',
      DETAILS,
      'Show the selected thing, the next box and the sensors',
      () => {
        isPanelOpen.value = !isPanelOpen.value
      },
    ),
    done: h(
      'button',
      { testid: 'edit-done', class: 'primary', onclick: () => (store.isEditing.value = false) },
      'Done',
    ),
  }
  isPanelOpen.watch((isOpen) => buttons.details.setAttribute('aria-expanded', String(isOpen)))
  store.status.watch((status) => {
    nameEdit(buttons.undo, 'Undo', status?.undo ?? '', 'Ctrl+Z')
    nameEdit(buttons.redo, 'Redo', status?.redo ?? '', 'Ctrl+Shift+Z')
  })
  const showSelection = (): void => {
    buttons.remove.disabled = !editor.isBoxSelected
    buttons.left.disabled = buttons.right.disabled = !editor.selected
  }
  store.selection.watch(showSelection)
  store.frame.watch(showSelection)
  const tools = h('div', { class: 'edit-tools', role: 'toolbar', 'aria-label': 'Edits' }, ...Object.values(buttons))
  return h('section', { class: 'edit-bar', testid: 'edit-bar', 'aria-label': 'Edit mode' }, tools)
}

/** A button of the bar. */
export function barButton(
  testid: string,
  label: string,
  path: string,
  title: string,
  onclick: () => void,
  isIcon = false,
): HTMLButtonElement {
  const names = { title: title || label, ...(isIcon && { 'aria-label': label, class: 'square' }) }
  return h('button', { testid, type: 'button', onclick, ...names }, icon(path), !isIcon && h('span', {}, label))
}

/** Names the edit that Undo or Redo would change. */
export function nameEdit(button: HTMLButtonElement, label: string, edit: string, keys: string): void {
  button.disabled = !edit
  button.title = edit ? `${label}: ${edit} (${keys})` : `${label} (${keys})`
  button.setAttribute('aria-label', edit ? `${label}: ${edit}` : label)
}

function panel(store: Store, editor: Editor): HTMLElement {
  return h(
    'aside',
    { class: 'panel menu edit', id: 'edit', testid: 'edit', 'aria-label': 'Edit' },
    selection(store, editor),
    nextBox(editor),
    sensors(store, editor),
  )
}

/** The selected thing and its pose. */
function selection(store: Store, editor: Editor): HTMLElement {
  const choose = (value: string): void => {
    store.selection.value = value
    editor.showSelected()
  }
  const select = choice('edit-selection', choose, { 'aria-label': 'Selected' })
  /** Places the selected thing; the fields then show where it is, also if the place was refused. */
  const place = async (): Promise<void> => {
    if ([x, y, yaw].every((field) => field.value)) {
      editor.show({ x: Number(x.value), y: Number(y.value), yaw: Number(yaw.value) * DEGREE })
      await editor.commit()
    } else store.warning.value = 'A position and a heading are numbers.'
    show(true)
  }
  const x = numberField('edit-x', { step: 0.05, onchange: place })
  const y = numberField('edit-y', { step: 0.05, onchange: place })
  const yaw = numberField('edit-yaw', { step: 5, onchange: place, title: 'Left turns are positive; 0 looks along x' })

  function show(isForced: boolean): void {
    const names = editor.names
    setOptions(select, { '': 'Nothing', ...Object.fromEntries(names.map((one) => [one, one])) })
    select.value = store.selection.value
    const selected = editor.selected
    const values = selected ? [selected.x, selected.y, selected.yaw / DEGREE] : []
    for (const [i, field] of [x, y, yaw].entries()) {
      field.disabled = !selected
      const text = selected ? String(round(values[i], i < 2 ? 1000 : 10)) : ''
      if ((isForced || document.activeElement !== field) && field.value !== text) field.value = text
    }
  }

  for (const observable of [store.frame, store.preview]) observable.watch(() => show(false))
  store.selection.watch(() => show(true))
  const hint = h('p', { class: 'edit-hint' })
  setText(hint, 'Drag a vehicle or a box. Turn it at its handle. Keys: arrows, [ and ]; with Shift in small steps.')
  return section('Selected', select, labelled('x [m]', x), labelled('y [m]', y), labelled('Heading [°]', yaw), hint)
}

/** Size and mass of the box that is added next. */
function nextBox(editor: Editor): HTMLElement {
  const set = (): void => {
    const [length, width, height] = sizes.map((field) => Number(field.value))
    editor.shape.value = { size: [length, width, height], mass: Number(mass.value) }
  }
  const sizes = [...'xyz'].map((axis, i) =>
    numberField(`edit-size-${axis}`, {
      min: 0.01,
      step: 0.05,
      'aria-label': `${['Length', 'Width', 'Height'][i]} of the next box [m]`,
      onchange: set,
    }),
  )
  const mass = numberField('edit-mass', { min: 0.001, step: 0.1, onchange: set })
  editor.shape.watch((shape) => {
    for (const [i, field] of sizes.entries()) field.value = String(shape.size[i])
    mass.value = String(shape.mass)
  })
  return section(
    'Next box',
    h('div', { class: 'labelled' }, h('span', {}, 'Size [m]'), h('div', { class: 'triple' }, ...sizes)),
    labelled('Mass [kg]', mass),
  )
}

export function numberField(testid: string, attributes: Record<string, unknown>): HTMLInputElement {
  return h('input', { type: 'number', testid, ...(attributes as Record<string, string>) })
}

function round(value: number, parts = 1000): number {
  return Math.round(value * parts) / parts
}
