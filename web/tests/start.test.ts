import { beforeEach, describe, expect, test, vi } from 'vitest'

import { Actions } from '../src/actions'
import type { Plan } from '../src/messages'
import { banner } from '../src/panels/banner'
import { h } from '../src/panels/element'
import { start } from '../src/panels/start'
import { watchHint } from '../src/panels/watch'
import { Scenarios } from '../src/scenarios'
import { stillOf } from '../src/stills'
import { FakeSocket, frameOf, newPage, sceneOf, statusOf, vehicleOf, welcome } from './support'

const TITLES = { traffic: 'Town', practice: 'Track', traffic_rain: 'Rain', plane: 'Plane', parking: 'Lot' }
const offered = welcome({ scenarios: TITLES, has_start_screen: true })
const starting = {
  ...{ type: 'Starting' as const, stage: 'loading the world', share: null, remaining: null, scene: null, frame: null },
  ...{ scenario: 'traffic', has_start_screen: true },
}

beforeEach(() => {
  document.body.replaceChildren()
  location.hash = ''
})

function get<Kind extends HTMLElement = HTMLElement>(testid: string): Kind {
  const element = document.querySelector<Kind>(`[data-testid='${testid}']`)
  if (!element) throw new Error(`no element '${testid}'`)
  return element
}

const settle = () => new Promise((done) => setTimeout(done))

function page() {
  const { store, connection } = newPage()
  const actions = new Actions(store, connection)
  const line = banner(store, actions)
  const hints = h('section', {}, line)
  const openFiles = vi.fn(async () => {})
  const scenarios = new Scenarios(store, connection, async () => true)
  document.body.append(hints, watchHint(store, actions), ...start(store, actions, scenarios, openFiles, line))
  const socket = FakeSocket.latest
  socket.open()
  return { store, socket, hints, line, openFiles }
}

/** The simulator is ready, with the scenario behind the start screen. */
function ready(socket: FakeSocket): void {
  socket.receive(offered)
  socket.receive(sceneOf(['V1'], 'traffic'))
  socket.receive(statusOf())
  socket.receive(frameOf())
}

const isOpen = () => get<HTMLDialogElement>('start').open

describe('the start screen', () => {
  test('is there while the simulator starts, with its steps, and a card that is chosen waits for it', async () => {
    const { store, socket, hints, line } = page()
    expect(isOpen()).toBe(false)
    socket.receive(starting)
    expect([isOpen(), store.isTurning.value]).toEqual([true, true])
    expect(get('start').contains(line)).toBe(true)
    expect(line.textContent).toContain('Loading the world.')
    get('start-race').click()
    expect(isOpen()).toBe(false)
    expect(hints.contains(line)).toBe(true)
    expect(get('still-text').textContent).toBe('Race follows…')
    expect(get('still').dataset.name).toBe('practice')
    store.camera.value = 'Orbit'
    ready(socket)
    expect(isOpen()).toBe(false)
    expect(socket.request).toEqual({ type: 'LoadScenario', name: 'practice' })
    expect(get('still-text').textContent).toBe('Loading Race…')
    socket.receive(sceneOf(['R1'], 'practice'))
    socket.respond(frameOf(['R1']))
    await settle()
    expect([store.camera.value, store.vehicle.value, store.isTurning.value]).toEqual(["Driver's Eye", 'R1', false])
    expect(get('still').hidden).toBe(false)
    store.shownScene.value = store.scene.value
    expect(get('still').hidden).toBe(true)
  })

  test('enters a scenario that runs at once, and the build mode of an empty one', async () => {
    const { store, socket } = page()
    ready(socket)
    expect(isOpen()).toBe(true)
    socket.receive(statusOf({ is_paused: true }))
    get('start-build').click()
    expect(socket.request).toEqual({ type: 'LoadScenario', name: 'plane' })
    socket.receive(sceneOf(['V1'], 'plane'))
    socket.respond(frameOf())
    await settle()
    expect(socket.request).toEqual({ type: 'Resume' })
    socket.respond(frameOf())
    await settle()
    expect(store.isBuilding.value).toBe(true)
  })

  test('a watched card lets the simulator drive until a driving key is pressed', async () => {
    const { store, socket } = page()
    ready(socket)
    expect(get('watch').hidden).toBe(true)
    get('start-town-watch').click()
    expect(socket.request).toEqual({ type: 'LoadScenario', name: 'traffic' })
    socket.respond(frameOf())
    await settle()
    expect(socket.request).toEqual({ type: 'LetDrive', vehicle: 'V1' })
    socket.respond(frameOf(['V1'], { vehicles: { V1: vehicleOf({ is_autonomous: true }) } }))
    await settle()
    expect(store.watched.value).toBe('V1')
    expect(get('watch').hidden).toBe(false)
    expect(get('watch').textContent).toContain('to take the wheel')
    document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'c', code: 'KeyC', bubbles: true }))
    expect(socket.request).not.toHaveProperty('is_on')
    document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'w', code: 'KeyW', bubbles: true }))
    expect(socket.request).toEqual({ type: 'LetDrive', vehicle: 'V1', is_on: false })
    socket.respond(frameOf())
    await settle()
    expect(get('watch').hidden).toBe(true)
  })

  test('the hint of a watched card ends with a reset', async () => {
    const { store, socket } = page()
    ready(socket)
    store.watched.value = 'V1'
    socket.receive(frameOf(['V1'], { vehicles: { V1: vehicleOf({ is_autonomous: true }) } }))
    expect(get('watch').hidden).toBe(false)
    socket.receive(frameOf())
    expect([store.watched.value, get('watch').hidden]).toEqual(['', true])
  })

  test('a recording is replayed in a tab of its own', async () => {
    const { socket } = page()
    ready(socket)
    const tab = { location: { href: '' }, close: vi.fn() }
    vi.spyOn(window, 'open').mockReturnValue(tab as unknown as Window)
    const input = get<HTMLInputElement>('start-file')
    Object.defineProperty(input, 'files', { value: [new File([''], 'lap.mcap')], configurable: true })
    input.dispatchEvent(new Event('change'))
    await settle()
    expect(socket.request).toEqual({ type: 'ReplayRecording', name: 'lap.mcap' })
    socket.respond(frameOf(), '8765')
    await settle()
    expect(new URL(tab.location.href).port).toBe('8765')
  })

  test('lists all scenarios and says which one runs; an error of the choice is shown', async () => {
    const { store, socket } = page()
    ready(socket)
    const names = [...document.querySelectorAll<HTMLElement>('.all button')]
    expect(names.map(({ textContent }) => textContent)).toEqual(Object.values(TITLES))
    expect(get('start-scenario-traffic').getAttribute('aria-current')).toBe('true')
    expect(get('start-scenario-plane').hasAttribute('aria-current')).toBe(false)
    get('start-scenario-plane').click()
    socket.respond('out of memory')
    await settle()
    expect(store.error.value).toBe('Out of memory.')
    expect(get('still').dataset.name).toBe('traffic')
  })

  test('is not shown again after it was closed, for a link that names something, or if a scenario was chosen', () => {
    const { socket } = page()
    socket.receive(starting)
    get('start-close').click()
    ready(socket)
    expect(isOpen()).toBe(false)
    document.body.replaceChildren()
    location.hash = '#camera=orbit'
    ready(page().socket)
    expect(isOpen()).toBe(false)
    document.body.replaceChildren()
    location.hash = ''
    page().socket.receive(welcome())
    expect(isOpen()).toBe(false)
  })

  test('arrow keys go from card to card', () => {
    const { socket } = page()
    socket.receive(starting)
    const press = (key: string) =>
      document.activeElement?.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }))
    const focused = () => document.activeElement?.getAttribute('data-testid')
    expect(focused()).toBe('start-town')
    press('ArrowRight')
    expect(focused()).toBe('start-rain')
    press('ArrowLeft')
    expect(focused()).toBe('start-town')
  })

  test('a file that is chosen before the simulator is ready is opened when it is', async () => {
    const { socket, openFiles } = page()
    socket.receive(starting)
    const file = new File(['title: Mine'], 'mine.yaml')
    const input = get<HTMLInputElement>('start-file')
    Object.defineProperty(input, 'files', { value: [file], configurable: true })
    input.dispatchEvent(new Event('change'))
    expect(openFiles).not.toHaveBeenCalled()
    ready(socket)
    await settle()
    expect(openFiles).toHaveBeenCalledWith([file])
  })
})

test('a scenario without a still picture shows its floor plan while the scene is loaded', async () => {
  expect(stillOf('traffic')).toContain('traffic')
  expect(stillOf('folder/mine.yaml')).toBeNull()
  const { store, socket } = page()
  ready(socket)
  const plan: Plan = { image: 'scene/plan.png', bounds: [0, 0, 1, 1] }
  socket.receive({ ...sceneOf(['V1'], 'folder/mine.yaml'), title: 'My town', plan })
  await settle()
  store.sceneBytes.value = 1_440_000
  expect(get('still').hidden).toBe(false)
  expect(get('still').style.backgroundImage).toContain('scene/plan.png')
  expect(get('still-text').textContent).toBe('Loading My town… 1.4 MB')
  store.shownScene.value = store.scene.value
  expect(get('still').hidden).toBe(true)
})
