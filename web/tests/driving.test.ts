import { beforeEach, describe, expect, test, vi } from 'vitest'

import { Axis } from '../src/driving/axis'
import { Driver } from '../src/driving/driver'
import { listenToGamepad } from '../src/driving/gamepad'
import { listenToKeyboard } from '../src/driving/keyboard'
import { actionOf, KEYS, type KeyAction } from '../src/driving/keys'
import type { Command } from '../src/messages'
import { Headlights, Indicators } from '../src/messages'
import { connectedPage, frameOf, vehicleOf } from './support'

/** Listeners of earlier tests stay on `window`; each test has its own connection, so they do not interfere. */
function page(vehicles: readonly string[] = ['V1']) {
  const { store, connection, socket } = connectedPage(vehicles)
  const driver = new Driver(store, connection)
  const actions: KeyAction[] = []
  listenToKeyboard(driver, store, (action) => actions.push(action))
  const commands = (): Command[] => socket.of('Drive').map((message) => message.command)
  const latest = (): Command => commands().at(-1) ?? {}
  return { store, socket, driver, actions, commands, latest }
}

function key(type: 'keydown' | 'keyup', code: string, values: KeyboardEventInit = {}, target: EventTarget = window) {
  const event = new KeyboardEvent(type, { code, key: code, bubbles: true, cancelable: true, ...values })
  target.dispatchEvent(event)
  return event
}

beforeEach(() => {
  vi.useFakeTimers()
  document.body.replaceChildren()
  return () => {
    window.dispatchEvent(new Event('blur'))
    vi.useRealTimers()
  }
})

describe('the ramp of a key', () => {
  test('reaches full scale in a third of a second and returns as fast', () => {
    const axis = new Axis()
    for (let i = 0; i < 10; i++) axis.advance(1, 1 / 60)
    expect(axis.value).toBeCloseTo(0.5)
    axis.advance(1, 1)
    expect(axis.value).toBe(1)
    axis.advance(0, 1 / 6)
    expect(axis.value).toBeCloseTo(0.5)
    axis.advance(0, 1)
    expect(axis.value).toBe(0)
  })

  test('restarts at zero when the direction changes', () => {
    const axis = new Axis()
    axis.advance(1, 1)
    axis.advance(-1, 0.01)
    expect(axis.value).toBeCloseTo(-0.03)
  })
})

describe('keys', () => {
  const held: [string, Partial<Command>][] = [
    ['KeyW', { throttle: 1, steering: 0 }],
    ['ArrowUp', { throttle: 1, steering: 0 }],
    ['KeyS', { throttle: -1, steering: 0 }],
    ['ArrowDown', { throttle: -1, steering: 0 }],
    ['KeyA', { throttle: 0, steering: 1 }],
    ['ArrowLeft', { throttle: 0, steering: 1 }],
    ['KeyD', { throttle: 0, steering: -1 }],
    ['ArrowRight', { throttle: 0, steering: -1 }],
  ]
  test.each(held)('%s drives while it is held', (code, full) => {
    const { latest, commands } = page()
    expect(key('keydown', code).defaultPrevented).toBe(true)
    expect(commands().length).toBe(1) // in the same task
    vi.advanceTimersByTime(1000)
    expect(latest()).toEqual(full)
    key('keyup', code)
    vi.advanceTimersByTime(1000)
    expect(latest()).toEqual({ throttle: 0, steering: 0 })
    const count = commands().length
    vi.advanceTimersByTime(1000)
    expect(commands().length).toBe(count) // at rest nothing is sent
  })

  test('the throttle of a held key rises and falls gradually', () => {
    const { commands } = page()
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(500)
    key('keyup', 'KeyW')
    vi.advanceTimersByTime(500)
    const throttle = commands().map((command) => command.throttle ?? NaN)
    const top = throttle.indexOf(1)
    expect(throttle[0]).toBeGreaterThan(0)
    expect(throttle[0]).toBeLessThan(0.2)
    expect(throttle.slice(0, top)).toEqual(throttle.slice(0, top).sort((a, b) => a - b))
    expect(throttle.slice(top)).toEqual(throttle.slice(top).sort((a, b) => b - a))
    expect(new Set(throttle).size).toBeGreaterThan(10)
  })

  test('several keys combine; opposite keys cancel', () => {
    const { latest } = page()
    for (const code of ['KeyW', 'KeyA']) key('keydown', code)
    vi.advanceTimersByTime(1000)
    expect(latest()).toEqual({ throttle: 1, steering: 1 })
    key('keydown', 'KeyD')
    vi.advanceTimersByTime(1000)
    expect(latest()).toEqual({ throttle: 1, steering: 0 })
  })

  test('two keys of one direction count once', () => {
    const { latest } = page()
    for (const code of ['KeyW', 'ArrowUp']) key('keydown', code)
    vi.advanceTimersByTime(1000)
    expect(latest().throttle).toBe(1)
    key('keyup', 'KeyW')
    vi.advanceTimersByTime(1000)
    expect(latest().throttle).toBe(1)
  })

  test('auto-repeat and modifiers do nothing', () => {
    const { commands, actions } = page()
    key('keydown', 'KeyW', { repeat: true })
    key('keydown', 'KeyW', { ctrlKey: true })
    key('keydown', 'KeyC', { altKey: true })
    expect(commands()).toEqual([])
    expect(actions).toEqual([])
  })

  test.each(['input', 'select', 'textarea', 'dialog'])('a key in a %s does not drive', (tag) => {
    const { commands, actions } = page()
    const field = document.body.appendChild(document.createElement(tag))
    if (tag === 'dialog') field.setAttribute('open', '')
    key('keydown', 'KeyW', {}, field)
    key('keydown', 'KeyG', {}, field)
    expect(commands()).toEqual([])
    expect(actions).toEqual([])
  })

  test('Escape leaves a field', () => {
    page()
    const field = document.body.appendChild(document.createElement('input'))
    field.focus()
    key('keydown', 'Escape', {}, field)
    expect(document.activeElement).not.toBe(field)
  })

  test.each([
    ['the window loses the focus', () => window.dispatchEvent(new Event('blur'))],
    ['a field gets the focus', () => document.body.appendChild(document.createElement('input')).focus()],
    ['the Meta key is pressed', () => key('keydown', 'MetaLeft', { key: 'Meta' })],
    ['Alt opens the menu of the browser', () => key('keydown', 'AltLeft', { key: 'Alt', altKey: true })],
    ['F10 opens the menu of the browser', () => key('keydown', 'F10')],
    ['the menu key is pressed', () => key('keydown', 'ContextMenu')],
    ['a context menu opens', () => document.body.dispatchEvent(new Event('contextmenu', { bubbles: true }))],
    ['a link is dragged', () => document.body.dispatchEvent(new Event('dragstart', { bubbles: true }))],
    [
      'the page is hidden',
      () => {
        vi.spyOn(document, 'hidden', 'get').mockReturnValue(true)
        document.dispatchEvent(new Event('visibilitychange'))
      },
    ],
  ])('the vehicle stops at once when %s', (_, leave) => {
    const { latest, commands } = page()
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(300)
    expect(latest().throttle).toBeGreaterThan(0.5)
    leave()
    expect(latest()).toEqual({ throttle: 0, steering: 0 })
    const count = commands().length
    vi.advanceTimersByTime(1000)
    key('keydown', 'KeyW', { repeat: true }) // the key is still down, and has no effect
    expect(commands().length).toBe(count)
    key('keyup', 'KeyW')
    key('keydown', 'KeyW')
    expect(latest().throttle).toBeGreaterThan(0)
  })

  test('each action of the table is run by its key, and keys are unique', () => {
    const { actions } = page()
    const all = Object.values(KEYS).flat()
    const once = all.filter(({ action }) => !['forward', 'reverse', 'left', 'right'].includes(action))
    for (const { codes, isShifted } of once) key('keydown', codes[0], { shiftKey: isShifted ?? false })
    expect(actions).toEqual(once.map(({ action }) => action))
    const codes = all.flatMap(({ codes, isShifted }) => codes.map((code) => `${code}${isShifted ? ' with Shift' : ''}`))
    expect(new Set(codes).size).toBe(codes.length)
  })

  test('Backspace resets only with Shift, and "?" is the help on every layout', () => {
    expect(actionOf(new KeyboardEvent('keydown', { code: 'Backspace', key: 'Backspace' }))).toBeUndefined()
    expect(actionOf(new KeyboardEvent('keydown', { code: 'Minus', key: '?', shiftKey: true }))).toBe('help')
    expect(actionOf(new KeyboardEvent('keydown', { code: 'F9', key: 'x' }))).toBeUndefined()
  })
})

describe('the fly camera', () => {
  test('is moved by the keys, which do not drive', () => {
    const { store, commands, actions } = page()
    store.camera.value = 'Fly'
    const count = commands().length
    for (const code of ['KeyW', 'KeyA', 'ArrowRight', 'PageUp'])
      expect(key('keydown', code).defaultPrevented).toBe(true)
    vi.advanceTimersByTime(1000)
    expect(store.flyInput).toEqual({ ahead: 1, left: 1, up: 1, turn: -1, tilt: 0, isFast: false })
    key('keydown', 'ArrowUp', { shiftKey: true })
    expect(store.flyInput).toMatchObject({ tilt: 1, isFast: true })
    key('keyup', 'KeyW')
    expect(store.flyInput).toMatchObject({ ahead: 0, left: 1, isFast: false })
    vi.advanceTimersByTime(1000)
    expect(commands().slice(count)).toEqual([])
    expect(actions).toEqual([])
    window.dispatchEvent(new Event('contextmenu'))
    expect(store.flyInput).toMatchObject({ ahead: 0, left: 0, up: 0, turn: 0, tilt: 0 })
  })

  test('and driving: a key that is held has no effect after the change to the other', () => {
    const { store, latest, commands } = page()
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(500)
    store.camera.value = "Bird's Eye"
    expect(latest().throttle).toBe(1) // any other camera changes nothing
    store.camera.value = 'Fly'
    expect(latest().throttle).toBe(0)
    expect(store.flyInput.ahead).toBe(0)
    key('keydown', 'KeyD')
    expect(store.flyInput.left).toBe(-1)
    store.camera.value = 'Orbit'
    expect(store.flyInput.left).toBe(0)
    const count = commands().length
    vi.advanceTimersByTime(1000)
    expect(commands().length).toBe(count)
    key('keyup', 'KeyD')
    key('keydown', 'KeyD')
    vi.advanceTimersByTime(1000)
    expect(latest().steering).toBe(-1)
  })

  test('keeps its keys out of Edit mode and of fields', () => {
    const { store } = page()
    store.camera.value = 'Fly'
    key('keydown', 'KeyW', {}, document.body.appendChild(document.createElement('input')))
    expect(store.flyInput.ahead).toBe(0)
    key('keydown', 'KeyW')
    store.isEditing.value = true
    expect(store.flyInput.ahead).toBe(0)
  })
})

describe('the driver', () => {
  test('is blocked in autonomous mode, and the user is informed', () => {
    const { store, socket, commands } = page()
    socket.receive(frameOf([], { vehicles: { V1: vehicleOf({ is_autonomous: true }) } }))
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(500)
    expect(commands()).toEqual([])
    expect(store.notice.value).toContain('is in Autonomous mode')
  })

  test('releases the vehicle when another is selected', () => {
    const { store, socket, latest } = page(['V1', 'V2'])
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(300)
    store.vehicle.value = 'V2'
    expect(latest()).toEqual({ throttle: 0, steering: 0 })
    expect(socket.of('Release')).toEqual([{ type: 'Release', vehicle: 'V1' }])
    key('keyup', 'KeyW')
    key('keydown', 'KeyW')
    expect(socket.of('Drive').at(-1)?.vehicle).toBe('V2')
  })

  test('releases the vehicle when the page is closed', () => {
    const { socket } = page()
    key('keydown', 'KeyW')
    window.dispatchEvent(new Event('pagehide'))
    expect(socket.of('Release').length).toBe(1)
  })

  test('drives as a person', () => {
    const { socket } = page()
    key('keydown', 'KeyW')
    expect(socket.of('Drive')[0].source).toBe('person')
  })
})

describe('lamps', () => {
  test('a request is repeated for a quarter of a second, then the lamps are left as they are', () => {
    const { driver, commands, latest } = page()
    driver.toggleHeadlights(Headlights.LOW)
    expect(latest()).toEqual({ throttle: 0, steering: 0, headlights: Headlights.LOW })
    vi.advanceTimersByTime(240)
    expect(latest().headlights).toBe(Headlights.LOW)
    expect(commands().length).toBeGreaterThan(8)
    const count = commands().length
    vi.advanceTimersByTime(1000)
    expect(commands().length).toBeLessThanOrEqual(count + 1)
  })

  test('a second press switches off, also before the first was carried out', () => {
    const { driver, latest, socket } = page()
    driver.toggleIndicators(Indicators.HAZARD)
    driver.toggleIndicators(Indicators.HAZARD)
    expect(latest().indicators).toBe(Indicators.OFF)
    vi.advanceTimersByTime(1000)
    const lights = { ...vehicleOf().lights, headlights: Headlights.HIGH }
    socket.receive(frameOf([], { vehicles: { V1: vehicleOf({ lights }) } }))
    driver.toggleHeadlights(Headlights.HIGH)
    expect(latest().headlights).toBe(Headlights.OFF)
  })

  test('both kinds of lamps are requested while driving', () => {
    const { driver, latest } = page()
    key('keydown', 'KeyW')
    vi.advanceTimersByTime(500)
    driver.toggleHeadlights(Headlights.LOW)
    driver.toggleIndicators(Indicators.LEFT)
    const lamps = { headlights: Headlights.LOW, indicators: Indicators.LEFT }
    expect(latest()).toEqual({ throttle: 1, steering: 0, ...lamps })
  })
})

describe('a gamepad', () => {
  const button = (value = 0) => ({ value, pressed: value > 0.5, touched: value > 0 })

  const padOf = (index: number, mapping = 'standard') => {
    const buttons = Array.from({ length: 17 }, () => button())
    return { id: `Pad ${index}`, index, mapping, axes: [0, 0], buttons }
  }
  /** The gamepads that are connected now. */
  let pads: (ReturnType<typeof padOf> | null)[]

  function announce(type: 'gamepadconnected' | 'gamepaddisconnected', gamepad: ReturnType<typeof padOf>): void {
    window.dispatchEvent(Object.assign(new Event(type), { gamepad }))
  }

  function plug() {
    const all = page()
    const pad = padOf(1)
    pads = [null, pad]
    Object.defineProperty(navigator, 'getGamepads', { value: () => pads, configurable: true })
    vi.spyOn(document, 'hasFocus').mockReturnValue(true)
    listenToGamepad(all.driver, all.store)
    announce('gamepadconnected', pad)
    return { ...all, pad }
  }

  function unplug(pad: ReturnType<typeof padOf>): void {
    pads = pads.map((each) => (each === pad ? null : each))
    announce('gamepaddisconnected', pad)
  }

  test('the triggers drive and the left stick steers, without a ramp', () => {
    const { pad, latest } = plug()
    pad.buttons[7] = button(0.75)
    pad.axes[0] = -1
    vi.advanceTimersByTime(20)
    expect(latest()).toEqual({ throttle: 0.75, steering: 1 })
    pad.buttons[6] = button(1)
    vi.advanceTimersByTime(20)
    expect(latest().throttle).toBeCloseTo(-0.25)
  })

  test('a stick in its dead zone does nothing', () => {
    const { pad, commands } = plug()
    pad.axes[0] = 0.07
    vi.advanceTimersByTime(200)
    expect(commands()).toEqual([])
  })

  test.each([
    [0, { headlights: Headlights.LOW }],
    [1, { indicators: Indicators.HAZARD }],
    [3, { headlights: Headlights.HIGH }],
    [4, { indicators: Indicators.LEFT }],
    [5, { indicators: Indicators.RIGHT }],
  ])('button %i switches lamps once per press', (index, lamps) => {
    const { pad, latest } = plug()
    pad.buttons[index] = button(1)
    vi.advanceTimersByTime(200)
    expect(latest()).toMatchObject(lamps)
  })

  test('the vehicle stops when the gamepad is disconnected', () => {
    const { pad, latest } = plug()
    pad.buttons[7] = button(1)
    vi.advanceTimersByTime(20)
    unplug(pad)
    expect(latest()).toEqual({ throttle: 0, steering: 0 })
  })

  test.each(['standard', ''])('the vehicle stops although another device (mapping "%s") stays connected', (mapping) => {
    const { pad, latest, commands } = plug()
    const other = padOf(2, mapping)
    pads.push(other)
    announce('gamepadconnected', other)
    pad.buttons[7] = button(1)
    vi.advanceTimersByTime(20)
    expect(latest().throttle).toBe(1)
    unplug(pad)
    vi.advanceTimersByTime(1000)
    expect(latest()).toEqual({ throttle: 0, steering: 0 })
    const count = commands().length
    other.buttons[7] = button(0.5)
    vi.advanceTimersByTime(100)
    expect(mapping ? latest().throttle : count - commands().length).toBe(mapping ? 0.5 : 0)
    unplug(other)
  })

  test('a gamepad that cannot drive is named once', () => {
    const { store } = plug()
    const said: string[] = []
    store.notice.watch((text) => said.push(text))
    for (const pad of [padOf(3, ''), padOf(3, ''), padOf(4)]) announce('gamepadconnected', pad)
    expect(said.filter((text) => text.includes("'Pad 3' cannot drive")).length).toBe(1)
    expect(said.join()).not.toContain('Pad 4')
  })
})
