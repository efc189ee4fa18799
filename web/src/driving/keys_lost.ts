// The moments from which the page may get no keyup event for a held key: what the key does must end there.

/** Keys that open a menu of the browser or of the system, which then gets the keys. */
const MENU_KEYS = new Set(['Meta', 'Alt', 'F10', 'ContextMenu'])

/** Calls `release` when the focus leaves the page, the page is hidden, a native menu opens, or a native drag begins. */
export function whenKeysAreLost(release: () => void): void {
  for (const type of ['blur', 'contextmenu', 'dragstart', 'dragenter']) window.addEventListener(type, release)
  window.addEventListener('keydown', ({ key }) => MENU_KEYS.has(key) && release(), { capture: true })
  document.addEventListener('visibilitychange', () => document.hidden && release())
}
