// Which panels are open: none at the start, and on a small screen one at a time.
import type { Store } from '../store'

/** Screens with room for one panel; as in style.css. */
const ONE_PANEL = '(max-width: 719px), (max-height: 559px) and (pointer: coarse)'
/** Screens on which the small map leaves enough of the scene visible. */
const WIDE = '(min-width: 1200px)'

/** Opens the small map, once for each race, if the screen is wide. */
export function openMapForRaces(store: Store): void {
  let scene: Store['scene']['value'] = null
  store.frame.watch((frame) => {
    if (store.status.value?.episode) return // an environment may have many tracks, of which the map would show all
    if (!frame || scene === store.scene.value || !matchMedia(WIDE).matches) return
    if (!Object.values(frame.vehicles).some(({ race }) => race && race.lap_total > 0)) return
    scene = store.scene.value
    store.isMapOpen.value = true
  })
}

/** Closes a panel when the other one is opened on a small screen, or when the screen becomes small. */
export function showOnePanelOnSmallScreens(store: Store): void {
  const screen = matchMedia(ONE_PANEL)
  store.isMenuOpen.watch((isOpen) => {
    if (isOpen && screen.matches && store.isHudOpen.value) store.isHudOpen.value = false
  })
  store.isHudOpen.watch((isOpen) => {
    if (isOpen && screen.matches && store.isMenuOpen.value) store.isMenuOpen.value = false
  })
  screen.addEventListener('change', () => {
    if (screen.matches && store.isHudOpen.value) store.isMenuOpen.value = false
  })
}
