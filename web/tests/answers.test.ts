// What the page shows of a request that is not answered yet, and of one that is refused.
import { Quaternion, Vector3 } from 'three'
import { beforeEach, expect, test } from 'vitest'

import { Actions } from '../src/actions'
import { CalmEvents } from '../src/calm_events'
import { logOf, touched } from '../src/log'
import type { Episode, Event, MapScene } from '../src/messages'
import { bridge } from '../src/panels/bridge'
import { crashHint } from '../src/panels/crash_hint'
import { episode } from '../src/panels/episode'
import { notices } from '../src/panels/notice'
import { toolbar } from '../src/panels/toolbar'
import { recorder } from '../src/replay/recorder'
import { Labels, type LabelView } from '../src/scene/labels'
import { connectedPage, FILM, frameOf, sceneOf, statusOf, vehicleOf } from './support'

beforeEach(() => {
  localStorage.clear()
  document.body.replaceChildren()
})

function get<Kind extends HTMLElement = HTMLButtonElement>(testid: string): Kind {
  const found = document.querySelector<Kind>(`[data-testid='${testid}']`)
  if (!found) throw new Error(`no element '${testid}'`)
  return found
}

const settle = () => new Promise((done) => setTimeout(done))
const recording = {
  state: 'recording',
  file: 'a.mcap',
  duration: 1,
  size: 0,
  dropped: 0,
  error: '',
  download: '',
  film: FILM,
} as const

test('Record shows at once that it waits, a second press does nothing, and the press after the Status stops', async () => {
  const { store, connection, socket } = connectedPage()
  const { button, touchButton, section } = recorder(store, new Actions(store, connection))
  document.body.append(button, touchButton, section)
  get('record-button').click()
  for (const testid of ['record-button', 'touch-record', 'record']) expect(get(testid).ariaBusy).toBe('true')
  for (const testid of ['record-button', 'touch-record', 'record']) get(testid).click()
  expect(socket.of('Request').map(({ operation }) => operation.type)).toEqual(['StartRecording'])
  socket.respond(frameOf())
  await settle()
  get('record-button').click() // the page does not know yet that it records
  expect(socket.of('Request')).toHaveLength(1)
  socket.receive(statusOf({ recording }))
  await settle()
  expect(get('record-button').ariaBusy).toBe('false')
  get('record-button').click()
  expect(socket.request).toEqual({ type: 'StopRecording' })
})

test('Record can be used again after a failure', async () => {
  const { store, connection, socket } = connectedPage()
  document.body.append(recorder(store, new Actions(store, connection)).button)
  get('record-button').click()
  socket.respond('the disk is full')
  await settle()
  expect(store.error.value).toBe('The disk is full.')
  expect(get('record-button').ariaBusy).toBe('false')
  get('record-button').click()
  expect(socket.of('Request')).toHaveLength(2)
})

test('Connect shows that it waits for the answer', async () => {
  const { store, connection, socket } = connectedPage()
  document.body.append(bridge(store, connection, () => {}))
  const submit = () =>
    document.querySelector('form')?.dispatchEvent(new Event('submit', { cancelable: true, bubbles: true }))
  submit()
  submit()
  expect(get('connect').ariaBusy).toBe('true')
  expect(socket.of('Request')).toHaveLength(1)
  socket.respond('no such host')
  await settle()
  expect(get('connect').ariaBusy).toBe('false')
})

test('a button whose operation is refused is disabled, and its tooltip says why', () => {
  const { store, connection, socket } = connectedPage()
  const actions = new Actions(store, connection)
  document.body.append(toolbar(store, actions, recorder(store, actions).button, () => {}))
  store.isBuilding.value = true
  const usual = get('build-button').title
  socket.receive(statusOf({ refused: { UseMap: 'a race is in progress', StartRecording: 'not in a race' } }))
  expect(store.isBuilding.value).toBe(false)
  expect(get('build-button').disabled).toBe(true)
  expect(get('build-button').title).toBe('A race is in progress.')
  expect(get('record-button').title).toBe('Not in a race.')
  expect(get('edit-button').disabled).toBe(false)
  store.isBuilding.value = true // a key, or a map in a link
  expect(store.isBuilding.value).toBe(false)
  expect(store.notice.value).toBe('a race is in progress')
  socket.receive(statusOf())
  expect([get('build-button').disabled, get('build-button').title]).toEqual([false, usual])
  store.isBuilding.value = true
  expect(store.isBuilding.value).toBe(true)
})

test('after a recording, a card names it; its film shows how far it is, and is downloaded once', async () => {
  const { store, connection, socket } = connectedPage()
  const { button, card } = recorder(store, new Actions(store, connection))
  document.body.append(button, card)
  socket.receive(statusOf({ recording: { ...recording, duration: 12.3 } }))
  get('record-button').click()
  socket.respond(frameOf(), '/tmp/a.mcap')
  await settle()
  const done = { ...recording, state: 'off', download: 'a.mcap' } as const
  socket.receive(statusOf({ recording: done }))
  expect(card.hidden).toBe(false)
  expect(get('recorded-text').textContent).toBe('Recorded a.mcap, 12 s.')
  const clicked: string[] = []
  HTMLAnchorElement.prototype.click = function click() {
    clicked.push(this.href)
  }
  get('recorded-download').click()
  get('recorded-film').click()
  expect(socket.request).toEqual({ type: 'FilmRecording', camera: "Driver's Eye", vehicle: 'V1' })
  socket.respond(frameOf())
  await settle()
  const film = { ...FILM, state: 'filming', name: 'a.webm', share: 0.25 } as const
  socket.receive(statusOf({ recording: { ...done, film } }))
  expect(get('recorded-state').textContent).toBe('Filming: 25 %')
  expect(get('recorded-film').disabled).toBe(true)
  for (let i = 0; i < 2; i++)
    socket.receive(statusOf({ recording: { ...done, film: { ...film, state: 'done', share: 1 } } }))
  expect(clicked.map((url) => new URL(url).pathname)).toEqual(['/lab/recordings/a.mcap', '/lab/recordings/a.webm'])
  socket.receive(statusOf({ recording: { ...done, film: { ...FILM, error: 'no encoder' } } }))
  expect(get('recorded-state').textContent).toBe('No encoder.')
})

test('a Reset is offered 3 s after a crash, while somebody drives a vehicle that does not move', () => {
  const { store, connection, socket } = connectedPage()
  const hint = crashHint(store, new Actions(store, connection))
  document.body.append(hint)
  const collision = { type: 'Collision', vehicle: 'V1', other: 'wall', impulse: 1, time: 1 } as never
  const frame = (time: number, throttle: number, speed = 0, events: never[] = []) =>
    socket.receive({
      ...frameOf(['V1'], { time, events }),
      vehicles: { V1: vehicleOf({ throttle, velocity: new Float64Array([speed, 0, 0]) }) },
    } as never)
  frame(0.5, 1)
  frame(4.5, 1) // it stands, but nothing was hit
  expect(hint.hidden).toBe(true)
  frame(5, 0, 0, [{ ...(collision as object), time: 5 } as never])
  frame(9, 0) // nobody drives it
  expect(hint.hidden).toBe(true)
  frame(9.5, 1)
  expect(hint.hidden).toBe(false)
  get('crash-reset').click()
  expect(socket.request).toEqual({ type: 'Reset' })
  frame(0.1, 0)
  expect(hint.hidden).toBe(true)
  frame(1, 0, 0, [collision])
  frame(2, 1)
  frame(3, 1, 0.5) // it comes free
  frame(5, 1, 0)
  expect(hint.hidden).toBe(true)
  frame(6.1, 1, 0)
  expect(hint.hidden).toBe(false)
})

test('a vehicle on the edge of a road is told once to be off it, and to be back when it stays', () => {
  const calm = new CalmEvents()
  const position = new Float64Array(3)
  const event = (type: 'OffRoad' | 'BackOnRoad', time: number): Event => ({ type, time, vehicle: 'V1', position })
  const told = (time: number, ...events: Event[]) => calm.at(time, events).map(({ type, time }) => [type, time])
  expect(told(1, event('OffRoad', 1))).toEqual([['OffRoad', 1]])
  for (let time = 2; time < 6; time++) {
    expect(told(time, event('BackOnRoad', time))).toEqual([])
    expect(told(time + 0.5, event('OffRoad', time + 0.5))).toEqual([])
  }
  expect(told(7, event('BackOnRoad', 7))).toEqual([])
  expect(told(7.9)).toEqual([])
  expect(told(8)).toEqual([['BackOnRoad', 7]])
  expect(told(9)).toEqual([])
  expect(told(10, event('OffRoad', 10))).toEqual([['OffRoad', 10]])
  expect(told(0)).toEqual([]) // a reset
  expect(told(0.1, event('OffRoad', 0.1))).toEqual([['OffRoad', 0.1]])
})

test('what a vehicle touches is named in words', () => {
  const part = { type: 'MapModule', module: 'construction_box' }
  const modules = { construction_box: { title: 'Construction box' } }
  const map_scene = { parts: { corner_2: part }, modules } as unknown as MapScene
  const scene = { ...sceneOf(['V1', 'V2']), objects: { box_1: 'box.glb' }, map_scene }
  const names = ['corner_2', 'V2', 'box_1', 'wall', 'traffic_light_3']
  expect(names.map((name) => touched(name, scene))).toEqual([
    ...['a construction box', 'V2', 'box 1', 'the wall', 'traffic light 3'],
  ])
})

test('an environment shows its episode from above, and no events of rules that it does not have', () => {
  const { store, socket } = connectedPage(['V1', 'V2'])
  document.body.append(episode(store), notices(store))
  expect(get('episode').hidden).toBe(true)
  const now: Episode = {
    ...{ task: 'head_to_head', number: 3, cars: { V1: 'drives', V2: 'drives' }, gap: -0.42, succeeded: 2, ended: 4 },
  }
  socket.receive(statusOf({ episode: now }))
  expect(store.camera.value).toBe("Bird's Eye")
  const position = new Float64Array(3)
  const red = { type: 'RedLight', time: 4, vehicle: 'V1', light: 'light_1', position } as unknown as Event
  const hit = { type: 'Collision', time: 4, vehicle: 'V1', other: 'V2', impulse: 1, position } as Event
  socket.receive(frameOf(['V1', 'V2'], { time: 4.25, events: [red, hit] }))
  expect(get('episode-title').textContent).toBe('Head to head, episode 3, 4.3 s')
  expect(get('episode-cars').textContent).toBe('V1 and V2 drive. V2 is 0.4 m ahead of V1')
  expect(get('episode-before').textContent).toBe('Before: 2 of 4 cars succeeded')
  expect(get('notices').textContent).toBe('V1 hit V2')
  store.camera.value = 'Orbit'
  socket.receive(statusOf({ episode: { ...now, cars: { V1: 'failed', V2: 'succeeded' }, gap: null } }))
  expect(get('episode-cars').textContent).toBe('V2 succeeded, V1 failed')
  expect(store.camera.value).toBe('Orbit')
})

test('cameras that are off are information, and cameras that fail are an error', () => {
  const { store, socket } = connectedPage()
  const entries = logOf(store)
  socket.receive(statusOf({ cameras_note: 'the camera images are off' }))
  socket.receive(statusOf({ cameras_error: 'no OpenGL' }))
  expect(entries.value.slice(-2).map(({ level, text }) => [level, text])).toEqual([
    ['info', 'Cameras: The camera images are off.'],
    ['error', 'Cameras: No OpenGL.'],
  ])
})

test('labels: none of the own vehicle, of a far one, below that of a nearer one, or of traffic without the pointer', () => {
  const scene = sceneOf(['V1', 'V2', 'V3', 'V4', 'traffic_1'])
  scene.vehicles.traffic_1 = { ...scene.vehicles.traffic_1, is_traffic: true }
  const canvas = document.body.appendChild(document.createElement('canvas'))
  const labels = new Labels(canvas)
  labels.show(scene)
  const at = (x: number, y: number) => ({ position: new Vector3(x, y, 0), orientation: new Quaternion() })
  const vehicles = new Map([
    ['V1', at(1, 0)],
    ['V2', at(3, 0)],
    ['V3', at(3.1, 0)], // 10 pixels beside V2, and farther away
    ['V4', at(16, 0)],
    ['traffic_1', at(5, 0)],
  ])
  const view: LabelView = {
    ...{ viewed: 'V1', isOwnHidden: false, isFarShown: false, pointer: [0, 0] },
    ...{ eye: new Vector3(), up: new Vector3(0, 0, 1), project: (x, y) => [100 * x, 100 * y] },
  }
  const shown = (changes: Partial<LabelView> = {}, isShown = true) => {
    labels.update(vehicles, isShown, { ...view, ...changes })
    return [...document.querySelectorAll<HTMLElement>('.vehicle-labels span:not([hidden])')].map(
      ({ textContent }) => textContent,
    )
  }
  expect(shown()).toEqual(['V1', 'V2'])
  expect(shown({ isOwnHidden: true })).toEqual(['V2'])
  expect(shown({ isFarShown: true })).toEqual(['V1', 'V2', 'V4'])
  expect(shown({ viewed: 'V3' })).toEqual(['V1', 'V3']) // the viewed vehicle has precedence
  expect(shown({ pointer: [520, 10] })).toEqual(['V1', 'V2', 'traffic_1'])
  expect(shown({}, false)).toEqual([])
  labels.dispose()
})
