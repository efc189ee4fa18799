// Entry point of the page: creates the connection, the store, the panels and the 3D view.
import { Actions } from './actions'
import { listenToBuildKeys } from './building/build_keys'
import { buildPointer } from './building/build_pointer'
import { Builder } from './building/builder'
import { openMapFiles } from './building/map_files'
import { TrackBuilder } from './building/track_builder'
import { trackPointer } from './building/track_pointer'
import { UserFiles } from './building/user_files'
import { Connection } from './connection'
import { Driver } from './driving/driver'
import { listenToGamepad } from './driving/gamepad'
import { learnKeyCaps } from './driving/key_caps'
import { listenToKeyboard } from './driving/keyboard'
import type { KeyAction } from './driving/keys'
import { listenToEditKeys } from './editing/edit_keys'
import { Editor } from './editing/editor'
import { editPointer } from './editing/pointer'
import { logOf } from './log'
import { Headlights, Indicators } from './messages'
import { banner } from './panels/banner'
import { build } from './panels/build'
import { connectDialog } from './panels/connect'
import { crashHint } from './panels/crash_hint'
import { description } from './panels/description'
import { edit } from './panels/edit'
import { h } from './panels/element'
import { episode } from './panels/episode'
import { help } from './panels/help'
import { openMapForRaces, showOnePanelOnSmallScreens } from './panels/layout'
import { legend } from './panels/legend'
import { askAboutLinkChanges } from './panels/link_changes'
import { logPanel } from './panels/log'
import { measure } from './panels/measure'
import { menu } from './panels/menu'
import { minimap } from './panels/minimap'
import { modeHint } from './panels/mode_hint'
import { notices } from './panels/notice'
import { askPicture } from './panels/picture_dialog'
import { mayDiscard, mayRemoveTraffic, saveScenario } from './panels/save_dialog'
import { start } from './panels/start'
import { streamNote } from './panels/stream_note'
import { savedTheme, showTheme } from './panels/theme'
import { toolbar } from './panels/toolbar'
import { toggleFullScreen } from './panels/tools'
import { touch } from './panels/touch'
import { tour } from './panels/tour'
import { VehicleEvents } from './panels/vehicle_events'
import { watchHint } from './panels/watch'
import { requestRemoteView } from './remote_view'
import { filmButton } from './replay/film_button'
import { recorder } from './replay/recorder'
import { timeline } from './replay/timeline'
import { Scenarios } from './scenarios'
import { listenToFlyPointer } from './scene/flight'
import type { SceneView } from './scene/view'
import { Store } from './store'
import { Trails } from './trails'
import { followViewInLink } from './view_link'

document.querySelector('#loading')?.remove()
showTheme(savedTheme())
learnKeyCaps()
const canvas = document.querySelector<HTMLCanvasElement>('#scene')
if (!canvas) throw new Error('index.html has no canvas')
const store = new Store()
const worker = new Worker(new URL('./worker/worker.ts', import.meta.url), { type: 'module' })
const connection = new Connection(store, worker)
const actions = new Actions(store, connection)
actions.mayRemoveTraffic = mayRemoveTraffic
const driver = new Driver(store, connection)
const keys = help(() => guide.start())
const trails = new Trails()
const proposeFromLink = askAboutLinkChanges(store)
followViewInLink(store, actions, proposeFromLink)
const programs = connectDialog(store)
const guide = tour(store, programs.open)
const editor = new Editor(store, actions)
const builder = new Builder(store, actions)
const trackBuilder = new TrackBuilder(store, actions)
const userFiles = new UserFiles(store, actions)
/** Saves the edited scenario. */
const save = () => saveScenario(store, editor, userFiles)

/** Actions of keys that are not held. */
const KEY_ACTIONS: Partial<Record<KeyAction, () => void>> = {
  'low-beam': () => driver.toggleHeadlights(Headlights.LOW),
  'high-beam': () => driver.toggleHeadlights(Headlights.HIGH),
  'left-indicator': () => driver.toggleIndicators(Indicators.LEFT),
  'right-indicator': () => driver.toggleIndicators(Indicators.RIGHT),
  hazard: () => driver.toggleIndicators(Indicators.HAZARD),
  camera: () => actions.nextCamera(),
  'scene-light': () => actions.toggleSceneLight(),
  vehicle: () => actions.nextVehicle(),
  mode: () => actions.toggleMode(),
  menu: () => (store.isMenuOpen.value = !store.isMenuOpen.value),
  hud: () => (store.isHudOpen.value = !store.isHudOpen.value),
  edit: () => (store.isEditing.value = !store.isEditing.value),
  build: () => (store.isBuilding.value = !store.isBuilding.value),
  help: keys.toggle,
  log: () => (store.isLogOpen.value = !store.isLogOpen.value),
  minimap: () => (store.isMapOpen.value = !store.isMapOpen.value),
  trails: () => (store.areTrailsShown.value = !store.areTrailsShown.value),
  shapes: () => (store.areShapesShown.value = !store.areShapesShown.value),
  forces: () => (store.areForcesShown.value = !store.areForcesShown.value),
  axes: () => (store.areAxesShown.value = !store.areAxesShown.value),
  measure: () => (store.isMeasuring.value = !store.isMeasuring.value),
  describe: () => (store.isDescribed.value = !store.isDescribed.value),
  'zoom-in': () => actions.zoom(1),
  'zoom-out': () => actions.zoom(-1),
  'orbit-left': () => actions.orbit(-1, 0),
  'orbit-right': () => actions.orbit(1, 0),
  'orbit-up': () => actions.orbit(0, 1),
  'orbit-down': () => actions.orbit(0, -1),
  'full-screen': toggleFullScreen,
  screenshot: () => void actions.downloadView(),
  close: () => {
    for (const panel of [store.isMenuOpen, store.isHudOpen, store.isLogOpen, store.isMapOpen, store.isMeasuring])
      panel.value = false
  },
  pause: () => actions.togglePause(),
  step: () => void actions.step(1),
  reset: () => void actions.reset(),
}

const scenarios = new Scenarios(store, connection, () => mayDiscard('Another scenario', save))
const recording = recorder(store, actions)
const mainMenu = menu(store, connection, actions, recording.section, programs.open, scenarios)
document.body.prepend(toolbar(store, actions, recording.button, keys.toggle), mainMenu)
mainMenu.querySelector('.tools')?.append(filmButton(store, canvas))
showOnePanelOnSmallScreens(store)
openMapForRaces(store)
const vehicleEvents = new VehicleEvents()
const log = logOf(store)
const dock = h('div', { class: 'dock' }, minimap(store, trails), legend(store, connection), logPanel(store, log))
const measured = measure(store, canvas, () => actions.view)
const state = banner(store, actions)
const hints = [
  state,
  modeHint(store, actions),
  streamNote(store),
  recording.card,
  crashHint(store, actions),
  episode(store),
]
document.body.append(h('section', { class: 'hints', 'aria-label': 'Hints' }, guide.element, ...hints), programs.element)
canvas.after(description(store, vehicleEvents))
document.body.append(
  dock,
  touch(driver, store, actions, recording.touchButton),
  notices(store),
  keys.element,
  timeline(store, connection, actions),
)
canvas.after(measured)
const view = () => actions.view
canvas.after(editPointer(store, editor, canvas, view))
canvas.after(buildPointer(store, builder, canvas, view), trackPointer(store, trackBuilder, canvas, view))
const mayDiscardMap = () => mayDiscard('Another map', save)
const openFiles = openMapFiles(store, builder, userFiles, mayDiscardMap, askPicture, proposeFromLink)
document.body.append(watchHint(store, actions))
const [still, startScreen] = start(store, actions, scenarios, openFiles, state)
canvas.after(still)
document.body.append(startScreen, ...edit(store, editor, view, save))
/** Shows the whole map or race track in Build mode. */
const showAll = () => (trackBuilder.line ? trackBuilder : builder).showAll()
const mayReplace = async () => !store.hasUnsavedEdits.value || mayDiscardMap()
const files = { openFiles, userFiles, save, mayReplace }
document.body.append(...build(store, { builder, trackBuilder, editor, view, showAll, files, vehicleEvents }))
listenToEditKeys(store, editor, () => driver.stop())
listenToBuildKeys(store, builder, editor, showAll, () => driver.stop())
listenToKeyboard(driver, store, (action) => KEY_ACTIONS[action]?.())
listenToGamepad(driver, store)
listenToFlyPointer(store, canvas)
requestRemoteView(store, connection, canvas)
canvas.addEventListener('contextmenu', (event) => event.preventDefault()) // its right button moves the camera
// A click on the scene removes the focus from fields, so that keys drive again.
canvas.addEventListener('pointerdown', () => (document.activeElement as HTMLElement | null)?.blur())

// A hidden page needs few Frames.
document.addEventListener('visibilitychange', () => connection.subscribe({ frame_rate: document.hidden ? 5 : 60 }))

/** Access for the console of the browser and for tests. */
const debug = { store, connection, log, view: null as SceneView | null }
declare global {
  interface Window {
    autodrive: typeof debug
  }
}
window.autodrive = debug

// Large modules are loaded later; driving already works without them.
const needsReload = () => (store.reloadReason.value = 'parts of the page could not be loaded')
import('./panels/hud').then(({ hud }) => mainMenu.after(hud(store, connection, vehicleEvents)), needsReload)
import('./scene/view').then(({ showScene }) => {
  actions.view = debug.view = showScene(canvas, store, trails)
}, needsReload)
worker.addEventListener('error', needsReload)

connection.open()
