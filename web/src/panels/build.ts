// Build mode: its bar of buttons, and the panel with the pieces, the problems and the selected part.
import type { Builder } from '../building/builder'
import { wrapped } from '../building/fitting'
import type { UserFiles } from '../building/user_files'
import type { Editor } from '../editing/editor'
import type { MapModule, MapProblem, MapScene } from '../messages'
import { Observable } from '../observable'
import { sceneUrl } from '../scene/assets'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { barButton, nameEdit, numberField } from './edit'
import { h, setText } from './element'
import { choice, errorCount, labelled, section, setOptions } from './fields'
import { COPY, DETAILS, LOOP, MIRROR, REDO, REMOVE, SAVE, SET, SHOW_ALL, TURN_LEFT, UNDO } from './icons'
import { busy } from './pending'
import { saveMap } from './save_dialog'
import type { VehicleEvents } from './vehicle_events'

/** In a window of this width [CSS pixels] the panel would cover the scene; a button opens it. */
const NARROW = 719
const DEGREE = Math.PI / 180
/** A vehicle that has moved farther is elsewhere [m]. */
const NEAR = 0.05

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
      () => void busy(buttons.close, () => builder.close()),
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
    undo: barButton('build-undo', 'Undo', UNDO, '', () => void busy(buttons.undo, () => editor.undo())),
    redo: barButton('build-redo', 'Redo', REDO, '', () => void busy(buttons.redo, () => editor.redo())),
    all: barButton('build-all', 'Show all', SHOW_ALL, 'Show the whole map (Home)', showAll),
    save: barButton('build-save', 'Save', SAVE, 'Download the map or the scenario as a YAML file', () => void save()),
    details: barButton('build-details', 'Panel', DETAILS, 'Show the pieces and the problems', () => {
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
    pieces(store, builder, view, isPanelOpen),
    start(store, builder, files),
  )
}

/** The palette: all modules with their drawings, then walls, blocks and signs. */
function pieces(
  store: Store,
  builder: Builder,
  view: () => SceneView | null,
  isPanelOpen: Observable<boolean>,
): HTMLElement {
  const middle = (): readonly [number, number] => view()?.groundPoint(0.5 * innerWidth, 0.5 * innerHeight) ?? [0, 0]
  const search = h('input', {
    ...{ type: 'search', testid: 'build-search', placeholder: 'Search', 'aria-label': 'Search the pieces' },
    oninput: () => filter(),
  })
  const grid = h('div', { class: 'pieces', testid: 'build-pieces' })
  const hint = h(
    'p',
    { class: 'edit-hint' },
    'Click an open end of a road, or take a piece. {KeyN}: next open end. While the simulation is paused ({KeyP}), edits are faster.',
  )
  let shown: MapScene['modules'] | null = null

  function card(id: string, title: string, image: HTMLElement | null, use: (isByKey: boolean) => void) {
    const onclick = ({ detail }: MouseEvent): void => {
      button.blur() // Enter then sets the piece
      use(detail === 0)
      if (innerWidth <= NARROW) isPanelOpen.value = false
    }
    const button = h('button', { class: 'piece', testid: `piece-${id}`, title, onclick }, image, h('span', {}, title))
    button.dataset.piece = id
    return button
  }

  function fill(scene: MapScene): void {
    const modules = Object.entries(scene.modules).map(([name, { title, image }]) => {
      const drawing = h('img', { src: sceneUrl(image).href, alt: '', loading: 'lazy' })
      return card(name, title, drawing, (isByKey) => {
        const hand = builder.hand.value
        if (hand?.kind === 'module' && hand.target && !hand.moved) builder.change(name)
        else if (isByKey) builder.takeAtEnd(name, middle())
        else builder.take(name, middle())
      })
    })
    const walls = (['wall', 'block'] as const).map((kind) =>
      card(kind, kind === 'wall' ? 'Wall' : 'Block', null, () => builder.start(kind)),
    )
    const signs = scene.props.map((kind) =>
      card(`sign-${kind}`, words(kind), null, () => builder.takeProp(kind, middle())),
    )
    grid.replaceChildren(...modules, ...walls, ...signs)
    filter()
  }

  /** Shows the pieces that fit: to the search, and to the open end. */
  function filter(): void {
    const wanted = search.value.trim().toLowerCase()
    const hand = builder.hand.value
    const fitting = hand?.kind === 'module' && hand.target ? new Set(builder.offered) : null
    const held = hand?.kind === 'module' ? hand.part.module : ''
    for (const button of grid.querySelectorAll<HTMLElement>('.piece')) {
      const id = button.dataset.piece ?? ''
      button.hidden =
        !(button.textContent ?? '').toLowerCase().includes(wanted) || (fitting !== null && !fitting.has(id))
      button.setAttribute('aria-pressed', String(id === held))
    }
  }

  store.scene.watch((scene) => {
    const map = scene?.map_scene
    if (!map || JSON.stringify(map.modules) === JSON.stringify(shown)) return
    shown = map.modules
    fill(map)
  })
  builder.hand.watch(filter)
  return section('Pieces', search, grid, hint)
}

/** The selected part and its values. */
function selection(store: Store, builder: Builder): HTMLElement {
  const title = h('p', { testid: 'build-selected', role: 'status' })
  const fields = {
    x: numberField('build-x', { step: 0.05, onchange: () => void move() }),
    y: numberField('build-y', { step: 0.05, onchange: () => void move() }),
    yaw: numberField('build-yaw', { step: 15, onchange: () => void move() }),
    length: numberField('build-length', { step: 0.1, min: 0.01, onchange: () => void size() }),
    width: numberField('build-width', { step: 0.1, min: 0.01, onchange: () => void size() }),
  }
  const isOpen = h('input', { type: 'checkbox', testid: 'build-open', role: 'switch' })
  isOpen.addEventListener('change', () => void builder.setValues({ open: isOpen.checked }))
  const rows = {
    x: labelled('x [m]', fields.x),
    y: labelled('y [m]', fields.y),
    yaw: labelled('Heading [°]', fields.yaw),
    length: labelled('Length [m]', fields.length),
    width: labelled('Width [m]', fields.width),
    open: labelled('Ends may stay open', isOpen),
  }
  const car = h(
    'button',
    { testid: 'build-car', onclick: () => void busy(car, () => builder.placeVehicle()) },
    'Place the vehicle here',
  )
  const element = section('Selected', title, ...Object.values(rows), car)

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
    const { part } = builder
    const names = builder.selected.value
    element.hidden = names.length === 0
    for (const row of [...Object.values(rows), car]) row.hidden = !part
    if (!part) {
      setText(title, `${names.length} pieces`)
      return
    }
    const module = part.type === 'MapModule' ? builder.module(part) : undefined
    setText(title, module ? `${names[0]}: ${module.title}` : names[0])
    const isSized = part.type === 'MapBlock' || module?.type === 'terrain' || module?.type === 'obstruction'
    for (const name of ['x', 'y', 'yaw'] as const) rows[name].hidden = part.type === 'MapWall'
    rows.length.hidden = rows.width.hidden = !isSized
    car.hidden = rows.open.hidden = !module || Object.keys(module.ports).length === 0
    if (part.type === 'MapWall') return
    const sized = part as Pick<MapModule, 'length' | 'width'>
    const values = { x: part.x, y: part.y, yaw: part.yaw / DEGREE, length: 0, width: 0 }
    if (isSized) {
      values.length = sized.length ?? module?.length ?? 0
      values.width = sized.width ?? module?.width ?? 0
    }
    for (const [name, field] of Object.entries(fields)) {
      const text = String(Math.round(1000 * values[name as keyof typeof values]) / 1000)
      if (field.value !== text) field.value = text
    }
    isOpen.checked = part.type === 'MapModule' && part.open === true
  }

  builder.selected.watch(show)
  store.scene.watch(show)
  return element
}

/** What is wrong with the map, with the place and, where it is known, the repair; then its open ends, and advice. */
function problems(store: Store, builder: Builder, vehicleEvents: VehicleEvents): HTMLElement {
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
    const row = h('div', { class: 'row' }, show, isKnown && repair)
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

/** Maps of the simulator and files to start from. */
function start(store: Store, builder: Builder, { userFiles, openFiles, mayDiscard }: Files): HTMLElement {
  const select = choice('build-template', (name) => name && void busy(select, () => builder.use({ name })), {
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
    if (files.length > 0) void busy(open, () => openFiles(files))
  })
  const open = h('button', { testid: 'build-open-file', onclick: () => file.click() }, 'Open a file')
  const own = choice('build-own', (name) => name && void busy(own, () => openOwn(name)), {
    'aria-label': 'Open a file of the folder',
  })
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

/** The problem without its place in a file. */
function shortened(text: string): string {
  return text.replace(/^placement \d+ '(.+?)': /, '$1: ').replace(/placement \d+ (?=')/g, '')
}

function words(name: string): string {
  const text = name.replaceAll('_', ' ')
  return text.charAt(0).toUpperCase() + text.slice(1)
}
