// Build mode: its bar of buttons, and the panel with the selected part, what to start from, the errors and the pieces.
import type { Builder } from '../building/builder'
import type { TrackBuilder } from '../building/track_builder'
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
import { choice, setOptions } from './fields'
import { ADD, COPY, DETAILS, LOOP, MIRROR, REDO, REMOVE, SAVE, SET, SHOW_ALL, START, TURN_LEFT, UNDO } from './icons'
import { busy } from './pending'
import { saveMap } from './save_dialog'
import { faults, randomTrack, shape } from './track'
import type { VehicleEvents } from './vehicle_events'

/** In a window of this width [CSS pixels] the panel would cover the scene; a button opens it. */
const NARROW = 719

/** How files of the user are opened and saved. */
export interface Files {
  userFiles: UserFiles
  openFiles: (files: readonly File[]) => Promise<void>
  /** Saves the edited scenario; returns whether it did. */
  save: () => Promise<boolean>
  /** Whether unsaved edits may be lost: asks if there are such. */
  mayReplace: () => Promise<boolean>
}

/** What Build mode works with. */
export interface Building {
  builder: Builder
  trackBuilder: TrackBuilder
  editor: Editor
  view: () => SceneView | null
  /** Shows the whole map or race track. */
  showAll: () => void
  files: Files
  vehicleEvents: VehicleEvents
}

/** The bar and the panel; they are shown in Build mode. */
export function build(store: Store, building: Building): HTMLElement[] {
  const isPanelOpen = new Observable(innerWidth > NARROW)
  const buttons = bar(store, building, isPanelOpen)
  const details = panel(store, building, isPanelOpen)
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
    // when the panel is there, beside which the track is shown
    queueMicrotask(() => building.trackBuilder.line && building.showAll())
  })
  return [buttons, details]
}

/** The buttons: those of pieces for a map, those of points for a race track, and those of both. */
function bar(store: Store, building: Building, isPanelOpen: Observable<boolean>): HTMLElement {
  const { builder, trackBuilder, editor, showAll, files } = building
  const ofMap = {
    set: barButton('build-set', 'Set', SET, 'Set the piece in hand (Enter)', () => void builder.set()),
    turn: barButton('build-turn', 'Turn', TURN_LEFT, 'Turn, or join by the next end ({KeyR})', () => builder.turn(1)),
    mirror: barButton('build-mirror', 'Mirror', MIRROR, 'Mirror the piece ({KeyM})', () => builder.mirror()),
    close: barButton(
      'build-close',
      'Close',
      LOOP,
      'Close the loop: add the roads from this open end to the nearest other one ({KeyC})',
      () => void busy(ofMap.close, () => builder.close()),
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
  }
  const ofTrack = {
    add: barButton(
      'track-add',
      'Add a point',
      ADD,
      'Add a point after the selected one (Enter)',
      () => void trackBuilder.addAfter(),
    ),
    remove: barButton(
      'track-remove',
      'Delete',
      REMOVE,
      'Delete the selected point (Delete)',
      () => void trackBuilder.remove(),
    ),
    here: barButton(
      'track-start',
      'Start line here',
      START,
      'The start line goes through the selected point',
      () => void trackBuilder.startHere(),
    ),
    reverse: barButton(
      'track-reverse',
      'Reverse',
      LOOP,
      'The cars drive in the other direction',
      () => void trackBuilder.reverse(),
    ),
  }
  const ofBoth = {
    undo: barButton('build-undo', 'Undo', UNDO, '', () => void busy(ofBoth.undo, () => editor.undo())),
    redo: barButton('build-redo', 'Redo', REDO, '', () => void busy(ofBoth.redo, () => editor.redo())),
    all: barButton('build-all', 'Show all', SHOW_ALL, 'Show the whole map (Home)', showAll),
    save: barButton('build-save', 'Save', SAVE, 'Download the map or the scenario as a YAML file', () => void save()),
    details: barButton('build-details', 'Panel', DETAILS, 'Show or hide the pieces and the errors', () => {
      isPanelOpen.value = !isPanelOpen.value
    }),
    done: h(
      'button',
      { testid: 'build-done', class: 'primary', onclick: () => (store.isBuilding.value = false) },
      'Done',
    ),
  }
  const save = (): Promise<boolean> => saveMap(store, builder, files.userFiles, files.save)
  store.status.watch((status) => {
    nameEdit(ofBoth.undo, 'Undo', status?.undo ?? '', 'Ctrl+Z')
    nameEdit(ofBoth.redo, 'Redo', status?.redo ?? '', 'Ctrl+Shift+Z')
  })
  const show = (): void => {
    const [hand, isSelected] = [builder.hand.value, builder.selected.value.length > 0]
    ofMap.set.disabled = !hand || hand.kind === 'block'
    ofMap.mirror.disabled = hand ? hand.kind !== 'module' : builder.part?.type !== 'MapModule'
    ofMap.turn.disabled = !isSelected && (!hand || hand.kind === 'wall' || hand.kind === 'block')
    ofMap.close.disabled = hand ? hand.kind !== 'module' || !hand.target : !isSelected
    ofMap.copy.disabled = !isSelected
    ofMap.remove.disabled = !isSelected && !hand
    ofTrack.remove.disabled = ofTrack.here.disabled = trackBuilder.selected.value < 0
    const isTrack = trackBuilder.line !== null
    for (const button of Object.values(ofMap)) button.hidden = isTrack
    for (const button of Object.values(ofTrack)) button.hidden = !isTrack
    ofBoth.details.setAttribute('aria-expanded', String(isPanelOpen.value))
  }
  for (const observable of [builder.hand, builder.selected, trackBuilder.selected, store.scene, isPanelOpen])
    (observable as Observable<unknown>).watch(show)
  const buttons = [ofMap, ofTrack, ofBoth].flatMap((group) => Object.values(group))
  const tools = h('div', { class: 'edit-tools', role: 'toolbar', 'aria-label': 'Building' }, ...buttons)
  // after a click with a pointer, Enter sets the piece; after one with a key, it presses the button again
  tools.addEventListener('click', (event) => {
    if (event.detail > 0 && document.activeElement instanceof HTMLElement) document.activeElement.blur()
  })
  return h('section', { class: 'edit-bar', testid: 'build-bar', 'aria-label': 'Build mode' }, tools)
}

function panel(store: Store, building: Building, isPanelOpen: Observable<boolean>): HTMLElement {
  const { builder, trackBuilder, view, files, vehicleEvents } = building
  const closeOnPhones = (): void => {
    if (innerWidth <= NARROW) isPanelOpen.value = false
  }
  const ofMap = [problems(store, builder, vehicleEvents), pieces(store, builder, view, closeOnPhones)]
  const ofTrack = [faults(store, trackBuilder, view), shape(store, trackBuilder)]
  store.scene.watch(() => {
    const isTrack = trackBuilder.line !== null
    for (const element of ofMap) element.hidden = isTrack
    for (const element of ofTrack) element.hidden = !isTrack
  })
  return h(
    'aside',
    { class: 'panel menu edit build', id: 'build', testid: 'build', 'aria-label': 'Build' },
    selection(store, builder),
    start(store, building),
    ...ofTrack,
    ...ofMap,
    randomTrack(store, trackBuilder, files.mayReplace),
  )
}

/** A new track, a picture, maps of the simulator and files to start from; folded after something was built. */
function start(store: Store, { builder, trackBuilder, files }: Building): HTMLElement {
  const { userFiles, openFiles, mayReplace } = files
  const use = async (name: string): Promise<void> => {
    select.value = ''
    if (name && (await mayReplace())) await builder.use({ name })
  }
  const select = choice('build-template', (name) => void busy(select, () => use(name)), {
    'aria-label': 'Start from a map',
  })
  store.scene.watch((scene) => {
    const templates = (scene?.map_scene ?? scene?.track_scene)?.templates ?? {}
    setOptions(select, { '': 'Choose a map', ...templates })
    select.value = ''
  })
  const startTrack = async (): Promise<void> => {
    if ((await mayReplace()) && (await trackBuilder.start())) trackBuilder.showAll()
  }
  const track = h('button', { testid: 'track-new', onclick: () => void busy(track, startTrack) }, 'New track')
  const picker = (testid: string, accept: string): HTMLInputElement => {
    const file = h('input', { type: 'file', accept, multiple: true, testid, hidden: true })
    file.addEventListener('change', () => {
      const chosen = [...(file.files ?? [])]
      file.value = ''
      if (chosen.length > 0) void busy(open, () => openFiles(chosen))
    })
    return file
  }
  const picture = picker('build-picture-file', '.png,.pgm,.yaml,.yml')
  const file = picker('build-file', '.yaml,.yml,.png,.pgm')
  const fromPicture = h('button', { testid: 'build-picture', onclick: () => picture.click() }, 'From a picture')
  fromPicture.title = 'Make a race track of a drawing, or of the map of a SLAM program (PNG, PGM)'
  const open = h('button', { testid: 'build-open-file', onclick: () => file.click() }, 'Open a file')
  const own = choice('build-own', (name) => name && void busy(own, () => openOwn(name)), {
    'aria-label': 'Open a file of the folder',
  })
  const openOwn = async (name: string): Promise<void> => {
    own.value = ''
    if (await mayReplace()) await userFiles.open(name)
  }
  store.files.watch((known) => {
    const titles = Object.entries(known ?? {}).map(([name, { kind, title }]) => [name, `${title || name} (${kind})`])
    own.hidden = titles.length === 0
    setOptions(own, { '': `Choose from the folder ${userFiles.folder}`, ...Object.fromEntries(titles) })
    own.value = ''
  })
  const content = [h('div', { class: 'row' }, track, fromPicture), select, own, h('div', { class: 'row' }, open)]
  const folded = h(
    'details',
    { class: 'section start-from', testid: 'build-start' },
    h('summary', {}, h('h2', {}, 'Start from')),
    ...content,
    picture,
    file,
  )
  store.isBuilding.watch((isBuilding) => {
    if (isBuilding) folded.open = !store.hasUnsavedEdits.value
  })
  const fold = (begun: readonly unknown[]): void => {
    if (begun.length > 0) folded.open = false
  }
  builder.selected.watch(fold)
  builder.placed.watch(fold)
  return folded
}
