// The table of keys and actions, for the keyboard handler and for the help. Keys are identified by their position.

export type KeyAction =
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
  | 'log'
  | 'minimap'
  | 'trails'
  | 'shapes'
  | 'forces'
  | 'axes'
  | 'measure'
  | 'describe'
  | 'zoom-in'
  | 'zoom-out'
  | 'orbit-left'
  | 'orbit-right'
  | 'orbit-up'
  | 'orbit-down'
  | 'full-screen'
  | 'screenshot'
  | 'edit'
  | 'build'
  | 'help'
  | 'close'
  | 'pause'
  | 'step'
  | 'reset'

export interface Key {
  action: KeyAction
  /** KeyboardEvent.code of each key for this action; with Shift if `isShifted`. */
  codes: readonly string[]
  /** Characters that run it, too, wherever the layout has them; the help names the first. */
  characters?: readonly string[]
  isShifted?: boolean
  /** Repeated while it is held. */
  isRepeated?: boolean
  description: string
}

const TURNS = { isShifted: true, isRepeated: true }

/** The keys by group, in the order of the help. */
export const KEYS: Record<string, readonly Key[]> = {
  Drive: [
    { action: 'forward', codes: ['KeyW', 'ArrowUp'], description: 'Drive forward' },
    { action: 'reverse', codes: ['KeyS', 'ArrowDown'], description: 'Drive in reverse' },
    { action: 'left', codes: ['KeyA', 'ArrowLeft'], description: 'Steer left' },
    { action: 'right', codes: ['KeyD', 'ArrowRight'], description: 'Steer right' },
  ],
  Lamps: [
    { action: 'low-beam', codes: ['KeyG'], description: 'Headlights, low beam' },
    { action: 'high-beam', codes: ['KeyH'], description: 'Headlights, high beam' },
    { action: 'left-indicator', codes: ['KeyL'], description: 'Left turn indicator' },
    { action: 'right-indicator', codes: ['KeyR'], description: 'Right turn indicator' },
    { action: 'hazard', codes: ['KeyE'], description: 'Hazard indicators' },
  ],
  View: [
    { action: 'camera', codes: ['KeyC'], description: 'Next camera' },
    { action: 'scene-light', codes: ['KeyB'], description: 'Scene light on or off' },
    { action: 'menu', codes: ['KeyM'], description: 'Menu' },
    { action: 'hud', codes: ['KeyU'], description: 'HUD' },
    { action: 'log', codes: ['KeyO'], description: 'Log' },
    { action: 'minimap', codes: ['KeyQ'], description: 'Small map' },
    { action: 'trails', codes: ['KeyT'], description: 'Driven lines' },
    { action: 'shapes', codes: ['Digit1'], description: 'Collision shapes' },
    { action: 'forces', codes: ['Digit2'], description: 'Contact forces' },
    { action: 'axes', codes: ['Digit3'], description: 'Axes of vehicles and sensors' },
    { action: 'measure', codes: ['KeyX'], description: 'Measure a distance' },
    { action: 'zoom-in', characters: ['+', '='], codes: ['NumpadAdd'], isRepeated: true, description: 'Zoom in' },
    { action: 'zoom-out', characters: ['-'], codes: ['NumpadSubtract'], isRepeated: true, description: 'Zoom out' },
    { action: 'orbit-left', codes: ['ArrowLeft'], ...TURNS, description: 'Orbit camera to the left' },
    { action: 'orbit-right', codes: ['ArrowRight'], ...TURNS, description: 'Orbit camera to the right' },
    { action: 'orbit-up', codes: ['ArrowUp'], ...TURNS, description: 'Orbit camera upwards' },
    { action: 'orbit-down', codes: ['ArrowDown'], ...TURNS, description: 'Orbit camera downwards' },
    { action: 'describe', codes: ['KeyY'], description: 'Scene in words for screen readers' },
    { action: 'full-screen', codes: ['KeyF'], description: 'Full screen' },
    { action: 'screenshot', codes: ['KeyI'], description: 'Screenshot of the view' },
    { action: 'edit', codes: ['KeyJ'], description: 'Edit mode' },
    { action: 'build', codes: ['KeyZ'], description: 'Build mode' },
    { action: 'help', codes: ['F1'], description: 'This help, also ?' },
    { action: 'close', codes: ['Escape'], description: 'Close what is open' },
  ],
  Simulation: [
    { action: 'mode', codes: ['KeyK'], description: 'Driving mode: Manual or Autonomous' },
    { action: 'vehicle', codes: ['KeyV'], description: 'Next vehicle' },
    { action: 'pause', codes: ['KeyP'], description: 'Pause or resume' },
    { action: 'step', codes: ['KeyN'], description: 'Run one tick, then pause' },
    { action: 'reset', codes: ['Backspace'], isShifted: true, description: 'Reset the simulation' },
  ],
}

/** Keys that are held, by KeyboardEvent.code: how they move the fly camera. */
export const FLY_KEYS: Record<string, readonly [axis: 'ahead' | 'left' | 'up' | 'turn' | 'tilt', sign: 1 | -1]> = {
  KeyW: ['ahead', 1],
  KeyS: ['ahead', -1],
  KeyA: ['left', 1],
  KeyD: ['left', -1],
  PageUp: ['up', 1],
  PageDown: ['up', -1],
  ArrowLeft: ['turn', 1],
  ArrowRight: ['turn', -1],
  ArrowUp: ['tilt', 1],
  ArrowDown: ['tilt', -1],
}

/** The action of a keyboard event, if any. */
export function actionOf(event: KeyboardEvent): KeyAction | undefined {
  if (event.key === '?') return 'help'
  return keyOf(event)?.action
}

/** KeyboardEvent.code; keys of the number pad without Num Lock count as those that they stand for, as arrows. */
export function codeOf({ code, key }: KeyboardEvent): string {
  return code.startsWith('Numpad') && key.length > 1 ? key : code
}

/** The key of a keyboard event; with Shift, the one with Shift goes before. */
export function keyOf(event: KeyboardEvent): Key | undefined {
  const isMeant = ({ codes, characters }: Key) => codes.includes(codeOf(event)) || characters?.includes(event.key)
  const keys = Object.values(KEYS)
    .flat()
    .filter((key) => isMeant(key) && (!key.isShifted || event.shiftKey))
  return keys.find(({ isShifted }) => isShifted) ?? keys[0]
}
