// Where the page begins: the connection, the store, and everything that looks at them.
import { Connection } from './connection'
import { toolbar } from './panels/toolbar'
import { Store } from './store'

const store = new Store()
const connection = new Connection(store)
document.body.append(toolbar(store))

/** A door for scripts in the browser's console: what the page knows, and its line to the simulator. */
const door: { store: Store; connection: Connection; view: unknown } = { store, connection, view: null }
declare global {
  interface Window {
    autodrive: typeof door
  }
}
window.autodrive = door

// Files of a glob may be missing: the panels then work without a scene.
const scenes = import.meta.glob<{ showScene: (canvas: HTMLCanvasElement, store: Store) => unknown }>('./scene/view.ts')
for (const load of Object.values(scenes)) {
  void load().then(({ showScene }) => {
    door.view = showScene(document.querySelector<HTMLCanvasElement>('#scene')!, store)
  })
}
const huds = import.meta.glob<{ hud: (store: Store, connection: Connection) => HTMLElement }>('./panels/hud.ts')
for (const load of Object.values(huds)) {
  void load().then(({ hud }) => {
    const panel = hud(store, connection)
    document.body.append(panel)
    store.isHudOpen.watch((isOpen) => (panel.hidden = !isOpen))
  })
}

connection.open()
