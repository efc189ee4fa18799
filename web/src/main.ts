// Where the page begins: the connection, the store, and everything that looks at them.
import { Actions } from './actions'
import { Connection } from './connection'
import { Driver } from './driving/driver'
import { listenToGamepad } from './driving/gamepad'
import { listenToKeyboard } from './driving/keyboard'
import type { Deed } from './driving/keys'
import { Headlights, Indicators } from './messages'
import { help } from './panels/help'
import { menu } from './panels/menu'
import { notices } from './panels/notice'
import { chosenTheme, showTheme } from './panels/theme'
import { toolbar } from './panels/toolbar'
import { touch } from './panels/touch'
import type { SceneView } from './scene/view'
import { Store } from './store'
import { stream } from './stream'

showTheme(chosenTheme())
const canvas = document.querySelector<HTMLCanvasElement>('#scene')!
const store = new Store()
const connection = new Connection(store)
const actions = new Actions(store, connection)
const driver = new Driver(store, connection)
const keys = help()

/** What a key does that is pressed, not held. */
const DEEDS: Partial<Record<Deed, () => void>> = {
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
  help: keys.toggle,
  close: () => (store.isMenuOpen.value = store.isHudOpen.value = false),
  pause: () => actions.togglePause(),
  step: () => void actions.step(1),
  reset: () => void actions.reset(),
}

document.body.prepend(toolbar(store, keys.toggle), menu(store, connection, actions))
document.body.append(touch(driver, store), notices(store), keys.element)
listenToKeyboard(driver, (deed) => DEEDS[deed]?.())
listenToGamepad(driver)
stream(store, connection, canvas)
// A click into the scene ends typing, and keys drive again.
canvas.addEventListener('pointerdown', () => (document.activeElement as HTMLElement | null)?.blur())

// A page that nobody looks at needs little.
document.addEventListener('visibilitychange', () => connection.subscribe({ frame_rate: document.hidden ? 5 : 60 }))

/** A door for scripts in the browser's console: what the page knows, and its line to the simulator. */
const door: { store: Store; connection: Connection; view: SceneView | null } = { store, connection, view: null }
declare global {
  interface Window {
    autodrive: typeof door
  }
}
window.autodrive = door

// Driving works while these, which are large, are still loaded.
void import('./panels/hud').then(({ hud }) => canvas.before(hud(store, connection)))
void import('./scene/view').then(({ showScene }) => (door.view = showScene(canvas, store)))

connection.open()
