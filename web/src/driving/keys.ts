// Which key does what: the one table for the keyboard and for the help. Keys are named by their place on the keyboard.

export type Deed =
  | 'forward'
  | 'reverse'
  | 'left'
  | 'right'
  | 'low-beam'
  | 'high-beam'
  | 'left-indicator'
  | 'right-indicator'
  | 'hazard'
  | 'camera'
  | 'scene-light'
  | 'vehicle'
  | 'mode'
  | 'menu'
  | 'hud'
  | 'help'
  | 'close'
  | 'pause'
  | 'step'
  | 'reset'

export interface Key {
  deed: Deed
  /** KeyboardEvent.code of each key that does it; with Shift where `isShifted`. */
  codes: readonly string[]
  isShifted?: boolean
  says: string
}

/** In the order in which the help shows them. */
export const KEYS: Record<string, readonly Key[]> = {
  Drive: [
    { deed: 'forward', codes: ['KeyW', 'ArrowUp'], says: 'Drive forward' },
    { deed: 'reverse', codes: ['KeyS', 'ArrowDown'], says: 'Drive in reverse' },
    { deed: 'left', codes: ['KeyA', 'ArrowLeft'], says: 'Steer left' },
    { deed: 'right', codes: ['KeyD', 'ArrowRight'], says: 'Steer right' },
  ],
  Lamps: [
    { deed: 'low-beam', codes: ['KeyG'], says: 'Headlights, low beam' },
    { deed: 'high-beam', codes: ['KeyH'], says: 'Headlights, high beam' },
    { deed: 'left-indicator', codes: ['KeyL'], says: 'Left turn indicator' },
    { deed: 'right-indicator', codes: ['KeyR'], says: 'Right turn indicator' },
    { deed: 'hazard', codes: ['KeyE'], says: 'Hazard indicators' },
  ],
  View: [
    { deed: 'camera', codes: ['KeyC'], says: 'Next camera' },
    { deed: 'scene-light', codes: ['KeyB'], says: 'Scene light on or off' },
    { deed: 'menu', codes: ['KeyM'], says: 'Menu' },
    { deed: 'hud', codes: ['KeyU'], says: 'HUD' },
    { deed: 'help', codes: ['F1'], says: 'This help, also ?' },
    { deed: 'close', codes: ['Escape'], says: 'Close help, HUD, menu' },
  ],
  Simulation: [
    { deed: 'mode', codes: ['KeyK'], says: 'Driving mode: Manual or Autonomous' },
    { deed: 'vehicle', codes: ['KeyV'], says: 'Next vehicle' },
    { deed: 'pause', codes: ['KeyP'], says: 'Pause or resume' },
    { deed: 'step', codes: ['KeyN'], says: 'Run one tick, then pause' },
    { deed: 'reset', codes: ['Backspace'], isShifted: true, says: 'Reset the simulation' },
  ],
}

/** What the key of an event does, if anything. */
export function deedOf(event: KeyboardEvent): Deed | undefined {
  if (event.key === '?') return 'help'
  const key = Object.values(KEYS).flat().find(({ codes }) => codes.includes(event.code))
  return key?.isShifted && !event.shiftKey ? undefined : key?.deed
}
