// Build mode: its bar of buttons, and the panel with the pieces, the problems and the selected part.
import type { Builder } from '../building/builder'
import type { UserFiles } from '../building/user_files'
import type { Editor } from '../editing/editor'
import { Observable } from '../observable'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { problems } from './build_checks'
import { pieces } from './build_pieces'
import { selection } from './build_selection'
import { barButton, nameEdit } from './edit'
import { h } from './element'
import { choice, section, setOptions } from './fields'
import { COPY, DETAILS, LOOP, MIRROR, REDO, REMOVE, SAVE, SET, SHOW_ALL, TURN_LEFT, UNDO } from './icons'
import { saveMap } from './save_dialog'
import type { VehicleEvents } from './vehicle_events'

/** In a window of this width [CSS pixels] the panel would cover the scene; a button opens it. */
const NARROW = 719

/** How files of the user are opened and saved. */
export interface Files {
  userFiles: UserFiles
  openFiles: (files: readonly File[]) => Promise<void>
  /** Saves the edited scenario; returns whether it did. */
  save: () => Promise<boolean>
  /** Asks whether unsaved edits may be lost. */
  mayDiscard: () => Promise<boolean>
}

/** The bar and the panel; they are shown in Build mode. */
export function build(
  store: Store,
  builder: Builder,
  editor: Editor,
  view: () => SceneView | null,
  showAll: () => void,
  files: Files,
  vehicleEvents: VehicleEvents,
): HTMLElement[] {
  const isPanelOpen = new Observable(innerWidth > NARROW)
  const buttons = bar(store, builder, editor, isPanelOpen, showAll, files)
  const details = panel(store, builder, view, isPanelOpen, files, vehicleEvents)
  const show = (): void => {
    const isBuilding = store.isBuilding.value
    buttons.hidden = !isBuilding
    details.hidden = !isBuilding || !isPanelOpen.value
    if (isBuilding) document.documentElement.style.setProperty('--edit-bar', `${buttons.offsetHeight}px`)
    document.documentElement.toggleAttribute('data-editing', store.isMapViewed)
  }
  new ResizeObserver(show).observe(buttons)
  isPanelOpen.watch(show)
  store.isEditing.watch(show)
  store.isBuilding.watch((isBuilding) => {
    show()
    if (!isBuilding) return
    store.isMenuOpen.value = false
  })
  return [buttons, details]
}

function bar(
  store: Store,
  builder: Builder,
  editor: Editor,
  isPanelOpen: Observable<boolean>,
  showAll: () => void,
  files: Files,
): HTMLElement {
  const buttons = {
    set: barButton('build-set', 'Set', SET, 'Set the piece in hand (Enter)', () => void builder.set()),
    turn: barButton('build-turn', 'Turn', TURN_LEFT, 'Turn, or join by the next end ({KeyR})', () => builder.turn(1)),
    mirror: barButton('build-mirror', 'Mirror', MIRROR, 'Mirror the piece ({KeyM})', () => builder.mirror()),
    close: barButton(
      'build-close',
      'Close',
      LOOP,
      'Close the loop: add the roads from this open end to the nearest other one ({KeyC})',
      () => void builder.close(),
    ),
    copy: barButton('build-copy', 'Copy', COPY, 'Take a copy of the selected piece (Ctrl+D)', () =>
      builder.duplicate(),
    ),
    remove: barButton(
      'build-remove',
      'Delete',
      REMOVE,
      'Delete the selected pieces, or the piece in hand (Delete)',
      () => void builder.remove(),
    ),
    undo: barButton('build-undo', 'Undo', UNDO, '', () => void editor.undo()),
    redo: barButton('build-redo', 'Redo', REDO, '', () => void editor.redo()),
    all: barButton('build-all', 'Show all', SHOW_ALL, 'Show the whole map (Home)', showAll),
    save: barButton('build-save', 'Save', SAVE, 'Download the map or the scenario as a YAML file', () => void save()),
    details: barButton('build-details', 'Pieces', DETAILS, 'Show the pieces and the problems', () => {
      isPanelOpen.value = !isPanelOpen.value
    }),
    done: h(
      'button',
      { testid: 'build-done', class: 'primary', onclick: () => (store.isBuilding.value = false) },
      'Done',
    ),
  }
  const save = (): Promise<boolean> => saveMap(store, builder, files.userFiles, files.save)
  isPanelOpen.watch((isOpen) => buttons.details.setAttribute('aria-expanded', String(isOpen)))
  store.status.watch((status) => {
    nameEdit(buttons.undo, 'Undo', status?.undo ?? '', 'Ctrl+Z')
    nameEdit(buttons.redo, 'Redo', status?.redo ?? '', 'Ctrl+Shift+Z')
  })
  const show = (): void => {
    const [hand, isSelected] = [builder.hand.value, builder.selected.value.length > 0]
    buttons.set.disabled = !hand || hand.kind === 'block'
    buttons.mirror.disabled = hand ? hand.kind !== 'module' : builder.part?.type !== 'MapModule'
    buttons.turn.disabled = !isSelected && (!hand || hand.kind === 'wall' || hand.kind === 'block')
    buttons.close.disabled = hand ? hand.kind !== 'module' || !hand.target : !isSelected
    buttons.copy.disabled = !isSelected
    buttons.remove.disabled = !isSelected && !hand
  }
  builder.hand.watch(show)
  builder.selected.watch(show)
  const tools = h('div', { class: 'edit-tools', role: 'toolbar', 'aria-label': 'Building' }, ...Object.values(buttons))
  // after a click with a pointer, Enter sets the piece; after one with a key, it presses the button again
  tools.addEventListener('click', (event) => {
    if (event.detail > 0 && document.activeElement instanceof HTMLElement) document.activeElement.blur()
  })
  return h('section', { class: 'edit-bar', testid: 'build-bar', 'aria-label': 'Build mode' }, tools)
}

function panel(
  store: Store,
  builder: Builder,
  view: () => SceneView | null,
  isPanelOpen: Observable<boolean>,
  files: Files,
  vehicleEvents: VehicleEvents,
): HTMLElement {
  return h(
    'aside',
    { class: 'panel menu edit build', id: 'build', testid: 'build', 'aria-label': 'Build' },
    selection(store, builder),
    problems(store, builder, vehicleEvents),
    pieces(store, builder, view, () => {
      if (innerWidth <= NARROW) isPanelOpen.value = false
    }),
    start(store, builder, files),
  )
}

/** Maps of the simulator and files to start from. */
function start(store: Store, builder: Builder, { userFiles, openFiles, mayDiscard }: Files): HTMLElement {
  const select = choice('build-template', (name) => name && void builder.use({ name }), {
    'aria-label': 'Start from a map',
  })
  store.scene.watch((scene) => {
    const templates = (scene?.map_scene ?? scene?.track_scene)?.templates ?? {}
    setOptions(select, { '': 'Choose a map', ...templates })
    select.value = ''
  })
  const accept = '.yaml,.yml,.png,.pgm'
  const file = h('input', { type: 'file', accept, multiple: true, testid: 'build-file', hidden: true })
  file.addEventListener('change', () => {
    const files = [...(file.files ?? [])]
    file.value = ''
    if (files.length > 0) void openFiles(files)
  })
  const open = h('button', { testid: 'build-open-file', onclick: () => file.click() }, 'Open a file')
  const own = choice('build-own', (name) => name && void openOwn(name), { 'aria-label': 'Open a file of the folder' })
  const openOwn = async (name: string): Promise<void> => {
    own.value = ''
    if (!store.hasUnsavedEdits.value || (await mayDiscard())) await userFiles.open(name)
  }
  store.files.watch((files) => {
    const titles = Object.entries(files ?? {}).map(([name, { kind, title }]) => [name, `${title || name} (${kind})`])
    own.hidden = titles.length === 0
    setOptions(own, { '': `Choose from the folder ${userFiles.folder}`, ...Object.fromEntries(titles) })
    own.value = ''
  })
  return section('Start from', select, own, h('div', { class: 'row' }, open, file))
}
