// Build mode: where pieces go, keys and buttons, and the requests that they send.
import { afterEach, beforeEach, expect, test, vi } from 'vitest'
import { Actions } from '../src/actions'
import { listenToBuildKeys } from '../src/building/build_keys'
import { Builder } from '../src/building/builder'
import {
  corners,
  fittingModules,
  freePlace,
  inMap,
  inPose,
  meeting,
  mirrorPort,
  movedPart,
  partAt,
  portAt,
  snapped,
  transformTo,
} from '../src/building/fitting'
import { TrackBuilder } from '../src/building/track_builder'
import { UserFiles } from '../src/building/user_files'
import { Editor } from '../src/editing/editor'
import type { Projection } from '../src/editing/outline'
import type { EditMap, MapModule, MapPort, MapScene, ModuleScene, Scene } from '../src/messages'
import { build } from '../src/panels/build'
import { VehicleEvents } from '../src/panels/vehicle_events'
import type { Store } from '../src/store'
import { connectedPage, frameOf, sceneOf, statusOf, vehicleOf } from './support'

const HALF = Math.PI / 2
const above: Projection = (x, y) => [400 + 100 * x, 300 - 100 * y]

function port(x: number, y: number, yaw: number, width = 0.6): MapPort {
  return { x, y, yaw, width, state: 'free' }
}

const STRAIGHT: ModuleScene = {
  ...{ title: 'Straight Road', type: 'road', length: 0.6, width: 0.6, image: 'scene/s.svg' },
  ports: { east: port(0.3, 0, 0), west: port(-0.3, 0, Math.PI) },
}
const CURVE: ModuleScene = {
  ...{ title: 'Curved Road', type: 'road', length: 1, width: 1, image: 'scene/c.svg' },
  ports: { west: port(-0.5, -0.2, Math.PI), north: port(0.2, 0.5, HALF) },
}
/** Bays on one side only: it has no mirror image. */
const PARKING: ModuleScene = {
  ...{ title: 'Parking', type: 'parking', length: 2, width: 0.9, image: 'scene/p.svg' },
  ports: { east: port(1, 0.15, 0) },
}
const LAWN: ModuleScene = { title: 'Lawn', type: 'terrain', length: 0.1, width: 0.1, image: 'scene/l.svg', ports: {} }
const NARROW: ModuleScene = { ...STRAIGHT, title: 'Lane', ports: { east: port(0.3, 0, 0, 0.3) } }

function part(module: string, x: number, y: number, yaw = 0): MapModule {
  const own = { open: false, length: null, width: null, height: null, z: 0, mass: null }
  return { type: 'MapModule', module, x, y, yaw, ...own }
}

function mapOf(parts: Record<string, MapModule> = {}, ports: MapScene['ports'] = {}): MapScene {
  const modules = { curve: CURVE, lane: NARROW, lawn: LAWN, parking: PARKING, straight: STRAIGHT }
  return {
    parts,
    ports,
    problems: [],
    modules,
    props: ['stop'],
    templates: { oval: 'Oval' },
    advice: [],
    faces: { stop: 'scene/stop.svg' },
  }
}

const opened: Store[] = []

const yes = () => Promise.resolve(true)

function page(map: MapScene = mapOf(), mayReplace = yes) {
  const it = connectedPage(['V1'])
  const scene = { ...sceneOf(['V1']), map_scene: map }
  it.socket.receive(scene)
  const actions = new Actions(it.store, it.connection)
  const builder = new Builder(it.store, actions)
  const editor = new Editor(it.store, actions)
  const userFiles = new UserFiles(it.store, actions)
  const files = { userFiles, openFiles: async () => {}, save: yes, mayReplace }
  const trackBuilder = new TrackBuilder(it.store, actions)
  const vehicleEvents = new VehicleEvents()
  const showAll = vi.fn()
  document.body.append(
    ...build(it.store, { builder, trackBuilder, editor, view: () => null, showAll, files, vehicleEvents }),
  )
  listenToBuildKeys(it.store, builder, editor, showAll, () => {})
  it.store.isBuilding.value = true
  opened.push(it.store)
  return { ...it, actions, builder, vehicleEvents, showAll }
}

function press(code: string, options: KeyboardEventInit = {}): void {
  document.body.dispatchEvent(new KeyboardEvent('keydown', { code, key: code, bubbles: true, ...options }))
}

/** Moves that the open end of a straight road offers. */
const AT_EAST = { road: { east: port(0.3, 0, 0), west: { ...port(-0.3, 0, Math.PI), state: 'joined' as const } } }

// its listeners stay
afterEach(() => {
  for (const store of opened.splice(0)) store.isBuilding.value = false
})

beforeEach(() => {
  document.body.replaceChildren()
  vi.stubGlobal(
    'ResizeObserver',
    class {
      observe(): void {}
    },
  )
})

test('a port of a module meets another: same place, opposite heading', () => {
  for (const yaw of [0, 0.3, 2, -3])
    for (const own of Object.values(CURVE.ports)) {
      const met = portAt(meeting(own, { x: 2, y: -1, yaw }), own)
      expect([met.x, met.y]).toEqual([expect.closeTo(2), expect.closeTo(-1)])
      expect(Math.cos(met.yaw - yaw)).toBeCloseTo(-1)
    }
})

test('points go to the axes of a pose and back', () => {
  const pose = { x: 1, y: 2, yaw: 0.7 }
  expect(inPose(pose, inMap(pose, 0.3, -0.4))).toEqual([expect.closeTo(0.3), expect.closeTo(-0.4)])
})

test('only modules with a port of that width fit', () => {
  expect(fittingModules(mapOf(), 0.6)).toEqual(['curve', 'parking', 'straight'])
  expect(fittingModules(mapOf(), 0.3)).toEqual(['lane'])
})

test('a curve is mirrored by its other port, a straight road is its own mirror image, parking on one side has none', () => {
  expect(mirrorPort(CURVE, 'west')).toBe('north')
  expect(['east', 'west']).toContain(mirrorPort(STRAIGHT, 'east'))
  expect(mirrorPort(PARKING, 'east')).toBeNull()
})

test('a piece snaps to the port at the pointer, and with one of its own ports near another', () => {
  const targets = [{ part: 'road', name: 'east', ...port(0.3, 0, 0) }]
  const hand = { pose: { x: 2, y: 0, yaw: 0 }, port: 'west' }
  expect(snapped(STRAIGHT, hand, targets, [440, 300], above)).toMatchObject({ port: 'west', pose: { x: 0.6 } })
  const near = { pose: { x: 0.7, y: 0.1, yaw: 0 }, port: 'east' }
  expect(snapped(STRAIGHT, near, targets, [470, 290], above)).toMatchObject({ port: 'west', pose: { x: 0.6, y: 0 } })
  expect(snapped(STRAIGHT, hand, targets, [600, 300], above)).toBeNull()
  expect(snapped(NARROW, hand, targets, [430, 300], above)).toBeNull()
})

test('a new piece has its place inside a closed wall, beside what is there', () => {
  const map = mapOf({ road: part('straight', 0, 0) })
  const corners: [number, number][] = [
    [-4, -4],
    [4, -4],
    [4, 4],
    [-4, 4],
  ]
  const wall = { type: 'MapWall' as const, points: corners, height: 0.4, thickness: 0.1, is_closed: true }
  const walled = { ...map, parts: { ...map.parts, wall } }
  expect(freePlace(walled, [1, 1], [2, 2])).toEqual([2, 2])
  const beside = freePlace(walled, [1, 1], [0, 0])
  expect(Math.hypot(...beside)).toBeLessThan(1.3)
  expect(Math.max(...beside.map(Math.abs))).toBeGreaterThan(0.8)
  const atWall = freePlace(walled, [1, 1], [-3.7, 0])
  expect(atWall[0] > -3.45 || atWall[0] < -4.55).toBe(true)
})

test('a click hits the smallest part', () => {
  const map = mapOf({ meadow: { ...part('lawn', 0, 0), length: 5, width: 5 }, road: part('straight', 1, 0, HALF) })
  expect(partAt(map, [1.2, 0.2])).toBe('road')
  expect(partAt(map, [2, 0])).toBe('meadow')
  expect(partAt(map, [9, 0])).toBe('')
  const wall = {
    type: 'MapWall' as const,
    points: [
      [0, 0],
      [2, 2],
    ] as [number, number][],
    height: 1,
    thickness: 0.1,
    is_closed: false,
  }
  expect(partAt({ ...map, parts: { ...map.parts, wall } }, [1.02, 1])).toBe('wall')
  expect(movedPart(wall, 1, -1)).toMatchObject({
    points: [
      [1, -1],
      [3, 1],
    ],
  })
})

test('the transform of a drawing puts its corners where they are wanted', () => {
  const wanted = [
    [10, 20],
    [110, 30],
    [90, 130],
    [0, 90],
  ] as const
  const values = transformTo(200, 100, wanted).slice(9, -1).split(',').map(Number)
  const shown = ([x, y]: readonly [number, number]) => {
    const at = (row: number) => values[row] * x + values[4 + row] * y + values[12 + row]
    return [at(0) / at(3), at(1) / at(3)]
  }
  const found = (
    [
      [0, 0],
      [200, 0],
      [200, 100],
      [0, 100],
    ] as const
  ).map(shown)
  expect(found.flat()).toEqual(wanted.flat().map((value) => expect.closeTo(value)))
  expect(corners({ x: 0, y: 0, yaw: 0 }, [2, 1])[0]).toEqual([1, 0.5])
})

test('an open end offers pieces: Page Up and Page Down step, R and M turn, Enter sets, and the road goes on', async () => {
  const { socket, builder, store } = page(mapOf({ road: part('straight', 0, 0) }, AT_EAST))
  press('KeyN')
  expect(builder.hand.value).toMatchObject({ part: { module: 'curve' }, port: 'west', target: { name: 'east' } })
  press('PageDown')
  expect(builder.hand.value).toMatchObject({ part: { module: 'parking' } })
  press('PageUp')
  press('KeyR')
  expect(builder.hand.value).toMatchObject({ port: 'north' })
  press('KeyM')
  expect(builder.hand.value).toMatchObject({ port: 'west', part: { x: 0.8, y: 0.2 } })
  press('Enter')
  expect(socket.request).toMatchObject({ type: 'EditMap', seen: { curve_1: null } })
  expect(socket.request.parts).toMatchObject({ curve_1: { module: 'curve', x: 0.8, y: 0.2, yaw: 0 } })
  socket.respond(frameOf(['V1']))
  await vi.waitFor(() => expect(builder.hand.value).toMatchObject({ target: { part: 'curve_1', name: 'north' } }))
  press('Enter') // before the new scene has arrived
  expect(socket.request.parts).toMatchObject({ curve_2: { module: 'curve' } })
  press('Escape')
  expect(builder.hand.value).toBeNull()
  press('Escape')
  press('Escape')
  expect(store.isBuilding.value).toBe(true)
  expect(store.notice.value).toContain('ends Build mode')
})

function release(code: string): void {
  document.body.dispatchEvent(new KeyboardEvent('keyup', { code, key: code, bubbles: true }))
}

test('arrows move the selected piece by 10 cm, with Shift by 1 cm, as one edit when the keys are released', async () => {
  const road = part('straight', 1, 2)
  const { socket, builder } = page(mapOf({ road }))
  builder.select('road')
  const sent = socket.sent.length
  press('ArrowRight')
  press('ArrowRight')
  press('ArrowDown', { shiftKey: true })
  builder.moveTo([9, 9], [0, 0], above, false) // the pointer does not take it meanwhile
  release('ArrowRight')
  expect(socket.sent.length).toBe(sent)
  release('ArrowDown')
  expect(socket.sent.length).toBe(sent + 1)
  const there = { x: expect.closeTo(1.2), y: expect.closeTo(1.99) }
  expect(socket.request).toMatchObject({ type: 'EditMap', parts: { road: there }, seen: { road } })
  // a key that is pressed before the simulator has answered moves it on from there
  press('ArrowUp')
  release('ArrowUp')
  expect(socket.sent.length).toBe(sent + 1)
  socket.receive({ ...sceneOf(['V1']), map_scene: mapOf({ road: part('straight', 1.2, 1.99) }) })
  socket.respond(frameOf(['V1']))
  await vi.waitFor(() => expect(socket.sent.length).toBe(sent + 2))
  expect(socket.request.parts).toMatchObject({ road: { x: expect.closeTo(1.2), y: expect.closeTo(2.09) } })
  expect(socket.request.seen).toMatchObject({ road: { x: 1.2, y: 1.99 } })
  socket.respond(frameOf(['V1']))
  await vi.waitFor(() => expect(builder.hand.value).toBeNull())
  expect(builder.selected.value).toEqual(['road'])
})

test('arrows move several selected pieces together, and a new piece in hand, which leaves its open end', async () => {
  const parts = { a: part('straight', 0, 0), b: part('curve', 3, 0) }
  const { socket, builder } = page(mapOf(parts, { a: AT_EAST.road }))
  builder.select('a', 'b')
  press('ArrowLeft')
  release('ArrowLeft')
  expect(socket.request.parts).toMatchObject({ a: { x: expect.closeTo(-0.1) }, b: { x: expect.closeTo(2.9) } })
  socket.respond('not there')
  await vi.waitFor(() => expect(builder.hand.value).toBeNull())
  press('KeyN')
  const before = builder.hand.value as { part: MapModule }
  press('ArrowUp')
  release('ArrowUp')
  expect(builder.hand.value).toMatchObject({ target: null, part: { y: expect.closeTo(before.part.y + 0.1) } })
  builder.leave()
  expect(builder.hand.value).toMatchObject({ part: { y: expect.closeTo(before.part.y + 0.1) } })
})

test('a piece that is chosen with a key begins at the first open end to which it fits', () => {
  const { builder } = page(mapOf({ road: part('straight', 0, 0) }, AT_EAST))
  const card = (name: string) => document.querySelector<HTMLElement>(`[data-piece="${name}"]`)
  card('straight')?.click() // without a pointer
  expect(builder.hand.value).toMatchObject({ target: { part: 'road', name: 'east' }, part: { x: expect.closeTo(0.6) } })
  press('Escape')
  card('lane')?.click() // it fits to no end: the nearest free place
  expect(builder.hand.value).toMatchObject({ target: null, part: { module: 'lane', y: expect.closeTo(0) } })
  expect((builder.hand.value as { part: MapModule }).part.x).toBeGreaterThan(0.6)
  press('Escape')
  card('straight')?.dispatchEvent(new MouseEvent('click', { bubbles: true, detail: 1 }))
  expect(builder.hand.value).toMatchObject({ target: null })
})

test('Delete removes the piece in hand, Home shows the whole map, and a replay ends Build mode', () => {
  const { builder, showAll, socket, store } = page()
  builder.take('curve', [1, 1])
  press('Delete')
  expect(builder.hand.value).toBeNull()
  press('Home')
  expect(showAll).toHaveBeenCalledOnce()
  const timeline = { start: 0, end: 1, marks: [] } as unknown as Scene['timeline']
  socket.receive({ ...sceneOf(['V1']), timeline })
  expect(store.isBuilding.value).toBe(false)
})

test('a refused piece stays in hand', async () => {
  const { socket, builder } = page()
  builder.take('curve', [1, 1])
  press('Enter')
  socket.respond('not here')
  await new Promise((done) => setTimeout(done))
  expect(builder.hand.value).toMatchObject({ part: { module: 'curve', x: 1 } })
})

test('the selected part is turned, copied and removed, with what the page knows of it', () => {
  const road = part('straight', 1, 2)
  const { socket, builder } = page(mapOf({ road }))
  builder.select('road')
  press('KeyR', { shiftKey: true })
  expect(socket.request).toMatchObject({ parts: { road: { yaw: expect.closeTo(-HALF) } }, seen: { road } })
  press('KeyD', { key: 'd', ctrlKey: true })
  expect(builder.hand.value).toMatchObject({ moved: '', part: { module: 'straight', x: 1 } })
  press('Escape')
  builder.select('road')
  press('Delete')
  expect(socket.request).toMatchObject({ type: 'EditMap', parts: { road: null } })
})

test('a group is selected, moved, turned, copied and removed in one edit each', async () => {
  const parts = { a: part('straight', 0, 0), b: part('straight', 0.6, 0), c: part('straight', 3, 0) }
  const ports = {
    a: { east: { ...port(0.3, 0, 0), state: 'joined' as const }, west: port(-0.3, 0, Math.PI) },
    b: { west: { ...port(0.3, 0, Math.PI), state: 'joined' as const }, east: port(0.9, 0, 0) },
    c: { west: port(2.7, 0, Math.PI), east: port(3.3, 0, 0) },
  }
  const { socket, builder } = page(mapOf(parts, ports))
  builder.select('a')
  press('KeyG')
  expect(builder.selected.value).toEqual(['a', 'b'])
  builder.lift()
  builder.moveTo([1.75, 0.1], [0, 0], above, false) // the eastern end of b is near c
  press('Enter')
  expect(socket.request).toMatchObject({
    parts: { a: { x: expect.closeTo(1.8), y: expect.closeTo(0) } },
    seen: { a: parts.a },
  })
  expect(socket.request.parts).toMatchObject({ b: { x: expect.closeTo(2.4) } })
  builder.select('a', 'b')
  press('KeyR')
  expect(socket.request.parts).toMatchObject({
    a: { x: expect.closeTo(0.3), y: expect.closeTo(-0.3), yaw: expect.closeTo(HALF) },
    b: { x: expect.closeTo(0.3), y: expect.closeTo(0.3), yaw: expect.closeTo(HALF) },
  })
  builder.select('a', 'b')
  press('KeyD', { key: 'd', ctrlKey: true })
  press('Enter')
  expect(Object.keys(socket.request.parts as object)).toEqual(['a_1', 'b_1'])
  builder.select('a')
  builder.toggle('c')
  press('Delete')
  expect(socket.request.parts).toEqual({ a: null, c: null })
  const many = Object.fromEntries(Array.from({ length: 1001 }, (_, i) => [`road_${i}`, part('straight', i, 0)]))
  expect(await builder.put(many)).toBe(false)
  expect(socket.request.parts).toEqual({ a: null, c: null })
  press('KeyA', { key: 'a', ctrlKey: true })
  expect(builder.selected.value).toEqual(['a', 'b', 'c'])
})

test('a wall is drawn by points and closed at its first one; a block by two corners', () => {
  const { socket, builder } = page()
  builder.start('wall')
  for (const [i, at] of (
    [
      [0, 0],
      [1, 0],
      [1, 1],
    ] as const
  ).entries())
    builder.addPoint(at, i === 3)
  builder.addPoint([0, 0], true)
  const sent = socket.request as unknown as EditMap
  expect(sent.parts.wall_1).toMatchObject({
    points: [
      [0, 0],
      [1, 0],
      [1, 1],
    ],
    is_closed: true,
  })
  builder.start('block')
  builder.addPoint([0, 0], false)
  builder.addPoint([2, -1], false)
  expect(socket.request.parts).toMatchObject({ block_1: { x: 1, y: -0.5, length: 2, width: 1 } })
})

test('the palette is searched and shows what fits', () => {
  page(mapOf({ road: part('straight', 0, 0) }, AT_EAST))
  const visible = () =>
    [...document.querySelectorAll<HTMLElement>('.piece')].filter((one) => !one.hidden).map((one) => one.dataset.piece)
  const choose = (tab: string) =>
    document.querySelector<HTMLElement>(`[data-testid="build-tabs"] button[value="${tab}"]`)?.click()
  expect(visible()).toEqual(['curve', 'lane', 'parking', 'straight'])
  choose('signs')
  expect(visible()).toEqual(['sign-stop'])
  expect(document.querySelector<HTMLImageElement>('[data-piece="sign-stop"] img')?.src).toContain('scene/stop.svg')
  choose('things')
  expect(visible()).toEqual(['lawn', 'wall', 'block'])
  press('KeyN')
  expect(visible()).toEqual(['curve', 'parking', 'straight'])
  press('Escape')
  const search = document.querySelector<HTMLInputElement>('[data-testid="build-search"]')
  if (search) search.value = 'curv'
  search?.dispatchEvent(new Event('input'))
  expect(visible()).toEqual(['curve']) // of all tabs
  choose('things')
  expect(visible()).toEqual(['lawn', 'wall', 'block'])
})

const shownText = (testid: string) => document.querySelector(`[data-testid="${testid}"]`)?.textContent
const click = (testid: string) => document.querySelector<HTMLElement>(`[data-testid="${testid}"]`)?.click()

test('errors have words, a place and a repair; open ends are no errors', () => {
  const parts = { road_1: part('straight', 0, 0), road_2: part('straight', 0.65, 0) }
  const repair = { road_2: { ...parts.road_2, x: 0.6 } }
  const at = { x: 0.3, y: 0, vehicle: '', place: null }
  const { builder, socket } = page({
    ...mapOf(parts, AT_EAST),
    problems: [
      { kind: 'apart', text: '', parts: ['road_1', 'road_2'], repair, ...at },
      { kind: 'blocked', text: '', parts: ['wall_1', 'road_1'], repair: {}, ...at },
      { kind: 'unconnected', text: '', parts: ['road_1'], repair: {}, ...at },
    ],
  })
  const items = [...document.querySelectorAll('[data-testid="build-problems"] li')]
  expect(items.map((item) => item.querySelector('span')?.textContent)).toEqual([
    'Road 1 and Road 2 do not meet: 5.0 cm are between their ends.',
    'Wall 1 stands on a lane of Road 1. Move it.',
  ])
  expect(document.querySelector('.checks:not([hidden]) h2')?.textContent).toBe('2 errors')
  const [show, mend] = [...items[0].querySelectorAll('button')]
  show.click()
  expect(builder.selected.value).toEqual(['road_2'])
  mend.click()
  expect(socket.request).toMatchObject({ type: 'EditMap', parts: repair })
  expect(shownText('build-ends-state')).toBe('1 open end')
})

test('all open ends are closed, shown one after the other, or may stay open', async () => {
  const road = part('straight', 0, 0)
  const ports = { road: { east: port(0.3, 0, 0), west: port(-0.3, 0, Math.PI) } }
  const { builder, socket, store } = page(mapOf({ road }, ports))
  expect(shownText('build-ends-state')).toBe('2 open ends')
  expect(document.querySelector('.checks:not([hidden]) h2')?.textContent).toBe('No errors')
  click('build-leave-open')
  expect(socket.request).toMatchObject({ type: 'EditMap', parts: { road: { open: ['east', 'west'] } } })
  click('build-next-end')
  expect(builder.hand.value).toMatchObject({ target: { name: 'east' } })
  click('build-close-all')
  expect(socket.request).toMatchObject({ type: 'CloseLoop', part: '' })
  socket.receive({ ...sceneOf(['V1']), map_scene: mapOf({ road }, AT_EAST) })
  socket.respond(frameOf(['V1']))
  await vi.waitFor(() => expect(store.warning.value).toContain('1 open end is left'))
})

test('advice on a vehicle beside the road stays until it is back; a button puts it on the nearest road', () => {
  const outside = {
    kind: 'outside',
    text: "'V1' is off",
    x: 0,
    y: 0,
    parts: [],
    repair: {},
    vehicle: 'V1',
    place: [1, 2, 3] as [number, number, number],
  }
  const { socket, vehicleEvents } = page({ ...mapOf(), advice: [outside] })
  const event = { vehicle: 'V1', time: 1, position: new Float64Array(3) }
  const shown = (x: number) => {
    const { pose, ...rest } = vehicleOf()
    const position = new Float64Array([x, 0, 0])
    socket.receive(frameOf([], { vehicles: { V1: { ...rest, pose: { ...pose, position } } } }))
    socket.receive(statusOf({}))
    return document.querySelectorAll('.problems li').length
  }
  expect(shown(0)).toBe(1)
  const put = [...document.querySelectorAll<HTMLElement>('[data-testid="build-advice"] button')][1]
  expect(put.textContent).toBe('Put V1 on the nearest road')
  put.click()
  expect(socket.request).toMatchObject({ type: 'Place', name: 'V1', x: 1, y: 2, yaw: 3 })
  vehicleEvents.add([{ type: 'OffRoad', ...event }])
  expect(shown(0.6)).toBe(1)
  vehicleEvents.add([{ type: 'BackOnRoad', ...event }])
  expect(shown(0.7)).toBe(0)
})

test('a piece that was offered at an open end is there again when the pointer has left the scene', () => {
  const { builder, socket } = page(mapOf({ road: part('straight', 0, 0) }, AT_EAST))
  press('KeyN')
  const offered = builder.hand.value
  expect(offered).toMatchObject({ kind: 'module', target: { part: 'road', name: 'east' } })
  builder.moveTo([3, 2], [700, 100], above, false)
  expect(builder.hand.value).toMatchObject({ target: null })
  builder.leave()
  expect(builder.hand.value).toEqual(offered)
  builder.moveTo([3, 2], [700, 100], above, false)
  builder.leave()
  document.querySelector<HTMLElement>('[data-piece="straight"]')?.click()
  press('Enter')
  expect(socket.request).toMatchObject({
    type: 'EditMap',
    parts: { straight_1: { module: 'straight', y: expect.closeTo(0) } },
  })
  builder.take('straight', [2, 2]) // not for an end: it stays where the pointer was
  builder.moveTo([3, 2], [700, 100], above, false)
  builder.leave()
  expect(builder.hand.value).toMatchObject({ target: null, part: { x: 3, y: 2 } })
})

test('undo and redo are those of the simulator, and Edit mode ends', () => {
  const { socket, store } = page()
  store.isEditing.value = true
  expect(store.isBuilding.value).toBe(false)
  store.isBuilding.value = true
  expect(store.isEditing.value).toBe(false)
  socket.receive(statusOf({ undo: 'add curve_1' }))
  press('KeyZ', { key: 'z', ctrlKey: true })
  expect(socket.request).toMatchObject({ type: 'Undo' })
})

test('a map that the traffic forbids is built without traffic if the user agrees', async () => {
  const { actions, builder, socket, store } = page()
  const car = { ...vehicleOf(), is_traffic: true }
  socket.receive(frameOf(['V1'], { vehicles: { V1: vehicleOf(), traffic_1: car } }))
  const why = "scenario.traffic: map 'empty' has no closed way of lanes"
  let may = false
  actions.mayRemoveTraffic = (text) => {
    expect(text).toContain('no closed way of lanes')
    return Promise.resolve(may)
  }
  const refused = builder.use({ name: 'empty' })
  socket.respond(why)
  expect(await refused).toBe(false)
  expect(store.error.value).toBe('')
  may = true
  const used = builder.use({ name: 'empty' })
  socket.respond(why)
  await vi.waitFor(() => expect(socket.request).toMatchObject({ type: 'RemoveTraffic' }))
  socket.respond(frameOf(['V1']))
  await vi.waitFor(() => expect(socket.request).toMatchObject({ type: 'UseMap', name: 'empty' }))
  socket.respond(frameOf(['V1']))
  expect(await used).toBe(true)
})

test('a race track has the tools of points in the bar, a map those of pieces; the panel is hidden and shown', () => {
  const { socket } = page()
  const button = (testid: string) => document.querySelector<HTMLButtonElement>(`[data-testid="${testid}"]`)
  expect([button('build-turn')?.hidden, button('track-add')?.hidden]).toEqual([false, true])
  expect(button('build-details')?.textContent).toBe('Panel')
  button('build-details')?.click()
  expect(document.querySelector<HTMLElement>('#build')?.hidden).toBe(true)
  button('build-details')?.click()
  const points = [[0, -4], [6, 0], [0, 4], [-6, 0]] as [number, number][] // biome-ignore format: points
  const line = { points, width: 1.2, barrier: 'wall' as const }
  const track_scene = { line, is_exact: true, problems: [], templates: {} }
  socket.receive({ ...sceneOf(['V1']), map_scene: null, track_scene })
  const shown = [...document.querySelectorAll<HTMLButtonElement>('.edit-tools button')].filter((one) => !one.hidden)
  expect(shown.map((one) => one.textContent)).toEqual([
    ...['Add a point', 'Delete', 'Start line here', 'Reverse', 'Undo', 'Redo', 'Show all', 'Save', 'Panel', 'Done'],
  ])
  expect(button('track-remove')?.disabled).toBe(true)
  expect(button('build-template')?.closest('details')?.open).toBe(true)
})

test('another map, a new track and a random track ask before they replace unsaved edits', async () => {
  const mayReplace = vi.fn(() => Promise.resolve(false))
  const { socket, store } = page(mapOf(), mayReplace)
  const sent = socket.sent.length
  store.hasUnsavedEdits.value = true
  const select = document.querySelector<HTMLSelectElement>('[data-testid="build-template"]')
  if (select) select.value = 'oval'
  select?.dispatchEvent(new Event('change'))
  click('track-new')
  click('track-random')
  await vi.waitFor(() => expect(mayReplace).toHaveBeenCalledTimes(3))
  await new Promise((done) => setTimeout(done))
  expect(socket.sent.length).toBe(sent)
})

/** Two straight roads in a row, whose outer ends may stay open. */
function twoRoads(): MapScene {
  const joined = { state: 'joined' as const }
  const open = { state: 'open' as const }
  return mapOf(
    { a: part('straight', 0, 0), b: part('straight', 0.6, 0) },
    {
      a: { east: { ...port(0.3, 0, 0), ...joined }, west: { ...port(-0.3, 0, Math.PI), ...open } },
      b: { west: { ...port(0.3, 0, Math.PI), ...joined }, east: { ...port(0.9, 0, 0), ...open } },
    },
  )
}

test('a piece with two ends snaps to a joint and is inserted there; without an open end, N goes to the joints', async () => {
  const { builder, socket, store } = page(twoRoads())
  builder.take('straight', [3, 3])
  builder.moveTo([0.31, 0.02], [431, 298], above, false)
  expect(builder.hand.value).toMatchObject({ target: { part: 'a', name: 'east', state: 'joined' } })
  press('Enter')
  expect(socket.request).toEqual({
    ...{ type: 'InsertModule', module: 'straight', part: 'a', port: 'east' },
    entry: expect.stringMatching(/east|west/),
  })
  socket.respond('the road is closed')
  await vi.waitFor(() => expect(builder.hand.value).toMatchObject({ part: { module: 'straight' } }))
  expect(store.error.value).toBe('The road is closed.')
  builder.take('parking', [3, 3]) // it has one end
  builder.moveTo([0.31, 0.02], [431, 298], above, false)
  expect(builder.hand.value).toMatchObject({ target: null })
  press('Escape')
  press('KeyN')
  expect(builder.hand.value).toMatchObject({ target: { part: 'a', name: 'east' } })
  expect(builder.offered).toEqual(['curve', 'straight'])
})

test('a selected piece is replaced by one that has the same ends, as one edit', async () => {
  const map = twoRoads()
  const CROSSING: ModuleScene = {
    ...{ title: 'Crossing', type: 'intersection', length: 0.6, width: 0.6, image: 'scene/x.svg' },
    ports: { ...STRAIGHT.ports, north: port(0, 0.3, HALF) },
  }
  const modules = { ...map.modules, crossing: CROSSING }
  const ports = {
    ...map.ports,
    a: { east: map.ports.a.east, west: { ...map.ports.a.west, state: 'joined' as const } },
  }
  const { builder, socket } = page({ ...map, ports, modules })
  builder.select('a')
  const offered = [...document.querySelectorAll<HTMLButtonElement>('[data-testid="build-replace"] button')]
  expect(offered.map((button) => button.dataset.module)).toEqual(['crossing'])
  offered[0].click()
  expect(socket.request).toMatchObject({
    type: 'EditMap',
    parts: { a: null, crossing_1: { module: 'crossing', x: expect.closeTo(0), y: expect.closeTo(0) } },
    seen: { crossing_1: null },
  })
  builder.select('b') // its one joint can also be that of a curve
  const names = () =>
    [...document.querySelectorAll<HTMLElement>('[data-testid="build-replace"] button')].map((one) => one.dataset.module)
  expect(names()).toEqual(['curve', 'parking', 'crossing'])
})
