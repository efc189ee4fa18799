// Edit mode: what the pointer hits, keys, buttons and the requests that they send.
import { afterEach, beforeEach, expect, test, vi } from 'vitest'
import { Actions, problems } from '../src/actions'
import type { UserFiles } from '../src/building/user_files'
import { listenToEditKeys } from '../src/editing/edit_keys'
import { Editor } from '../src/editing/editor'
import { cornersOf, type Extent, handleOf, isHit, type Projection, poseOf } from '../src/editing/outline'
import { edit } from '../src/panels/edit'
import { saveScenario } from '../src/panels/save_dialog'
import type { Store } from '../src/store'
import { connectedPage, frameOf, sceneOf, statusOf } from './support'

const CAR: Extent = { ahead: 0.07, size: [0.28, 0.2, 0.2], below: 0.03 }
/** From above: 100 pixels per metre, y of the screen downwards, things higher up appear larger. */
const above: Projection = (x, y, z) => [400 + 100 * x * (1 + z), 300 - 100 * y * (1 + z)]

const save = (store: Store, editor: Editor): Promise<boolean> =>
  saveScenario(store, editor, { folder: '' } as UserFiles)

const opened: Store[] = []

function page() {
  const it = connectedPage(['V1'])
  opened.push(it.store)
  const scene = { ...sceneOf(['V1']), object_sizes: { crate: [0.1, 0.2, 0.3] as [number, number, number] } }
  const pose = {
    position: new Float64Array([1, 2, 0.15]),
    orientation: new Float64Array([Math.SQRT1_2, 0, 0, Math.SQRT1_2]),
  }
  const frame = frameOf(['V1'], { objects: { crate: { pose } } })
  it.socket.receive(scene)
  it.socket.receive(frame)
  const editor = new Editor(it.store, new Actions(it.store, it.connection))
  it.store.isEditing.value = true
  return { ...it, editor, frame }
}

beforeEach(() => document.body.replaceChildren())
afterEach(() => {
  for (const store of opened.splice(0)) store.isEditing.value = false // its keys are not those of other tests
})

test('the outline of a turned vehicle lies where its body is', () => {
  const placed = poseOf({ name: 'V1', x: 1, y: 2, yaw: Math.PI / 2 }, CAR)
  const base = cornersOf(placed, CAR, above)
  // the middle is 0.07 m ahead, along y; front left is 0.14 m further and 0.1 m to the left, along -x
  expect(base?.[0][0]).toBeCloseTo(400 + 100 * (1 - 0.1))
  expect(base?.[0][1]).toBeCloseTo(300 - 100 * (2 + 0.07 + 0.14))
  expect(cornersOf(placed, CAR, () => null)).toBeNull()
})

test('the outline follows a thing that lies on its side, and one on top of another', () => {
  const places: number[][] = []
  const note: Projection = (x, y, z) => {
    places.push([x, y, z])
    return [x, y]
  }
  const box: Extent = { ahead: 0, size: [0.1, 0.2, 0.4], below: 0.2 }
  const position = new Float64Array([1, 2, 0.5])
  cornersOf({ position, orientation: new Float64Array([1, 0, 0, 0]) }, box, note)
  expect(places.map(([, , z]) => z)).toEqual([0.3, 0.3, 0.3, 0.3, 0.7, 0.7, 0.7, 0.7].map((z) => expect.closeTo(z)))
  places.length = 0
  // rolled by 90 degrees: its upper side shows along -y
  cornersOf({ position, orientation: new Float64Array([Math.SQRT1_2, Math.SQRT1_2, 0, 0]) }, box, note)
  expect(places[4]).toEqual([1.05, 1.8, 0.6].map((value) => expect.closeTo(value)))
})

test('a place is on a thing if it is in its image, or near it with a finger', () => {
  const placed = poseOf({ name: 'V1', x: 0, y: 0, yaw: 0 }, CAR)
  expect(isHit([407, 300], placed, CAR, above, 0)).toBe(true)
  expect(isHit([424, 300], placed, CAR, above, 0)).toBe(true) // on the front of the roof, which appears larger
  expect(isHit([432, 300], placed, CAR, above, 0)).toBe(false)
  expect(isHit([432, 300], placed, CAR, above, 14)).toBe(true)
})

test('the handle is ahead of the thing, at a distance that a finger hits', () => {
  const [front, end] = handleOf(poseOf({ name: 'V1', x: 0, y: 0, yaw: Math.PI }, CAR), CAR, above) ?? []
  expect(front?.[0]).toBeCloseTo(400 - 21)
  expect(end?.[0]).toBeCloseTo(400 - 21 - 38)
  expect(end?.[1]).toBeCloseTo(300)
})

test('arrows and brackets move the selected thing; one request follows when they are released', () => {
  const { store, socket, editor } = page()
  listenToEditKeys(store, editor, () => {})
  const drives = vi.fn()
  window.addEventListener('keydown', drives)
  store.selection.value = 'crate'
  const press = (code: string, shiftKey = false, type = 'keydown') =>
    window.dispatchEvent(
      new KeyboardEvent(type, { code, shiftKey, key: code === 'BracketLeft' ? '[' : code, bubbles: true }),
    )
  press('ArrowRight')
  press('ArrowRight')
  press('ArrowUp', true)
  press('BracketLeft')
  for (const code of ['ArrowRight', 'ArrowUp']) press(code, false, 'keyup')
  expect(socket.of('Request')).toEqual([])
  press('BracketLeft', false, 'keyup')
  expect(drives).not.toHaveBeenCalled()
  expect(socket.request).toMatchObject({ type: 'Place', name: 'crate' })
  const { x, y, yaw } = socket.request as unknown as { x: number; y: number; yaw: number }
  expect([x, y, yaw]).toEqual([expect.closeTo(1.1), expect.closeTo(2.01), expect.closeTo(Math.PI / 2 + Math.PI / 12)])
  store.isEditing.value = false
  press('ArrowRight')
  expect(drives).toHaveBeenCalledOnce()
})

test('a step whose key is released in a menu of the browser is one edit, too', () => {
  const { store, socket, editor } = page()
  listenToEditKeys(store, editor, () => {})
  store.selection.value = 'crate'
  window.dispatchEvent(new KeyboardEvent('keydown', { code: 'ArrowRight', key: 'ArrowRight' }))
  expect(socket.of('Request')).toEqual([])
  window.dispatchEvent(new Event('contextmenu'))
  expect(socket.request).toMatchObject({ type: 'Place', name: 'crate', x: expect.closeTo(1.05) })
  store.isEditing.value = false
})

test('a refused place is shown as a warning, and the thing is back where it was', async () => {
  const { store, socket, editor } = page()
  store.selection.value = 'crate'
  editor.show({ x: 5 })
  expect(editor.selected?.x).toBe(5)
  const done = editor.commit()
  socket.respond('it would overlap')
  await done
  expect(store.error.value).toBe('It would overlap.')
  expect(editor.selected).toMatchObject({ name: 'crate', x: 1, y: 2, yaw: expect.closeTo(Math.PI / 2) })
})

test('an error is one sentence for each problem, without the paths of files', () => {
  const text =
    '2 errors:\n  - boxes.b1.size 3: must be at least 0.001, not -1.0\n  - boxes.b1.mass: must be at least 0.001'
  expect(problems(new Error(text))).toEqual([
    'The height of b1 must be at least 0.001, not -1.0.',
    'The mass of b1 must be at least 0.001.',
  ])
  expect(problems(new Error("vehicles.V1 (line 3): 'V1' and 'crate' overlap at the start; move one of them"))).toEqual([
    "'V1' and 'crate' overlap at the start; move one of them.",
  ])
  expect(problems(new Error('a message was not understood: Expected `float` <= 10000.0 - at `$.operation.x`'))).toEqual(
    ['X must be at most 10000.'],
  )
  expect(problems('not connected')).toEqual(['Not connected.'])
})

test('a box that is refused leaves the fields at the latest box that was not', async () => {
  const { store, socket, editor } = page()
  document.body.append(
    ...edit(
      store,
      editor,
      () => null,
      () => save(store, editor),
    ),
  )
  const field = document.querySelector<HTMLInputElement>("[data-testid='edit-size-z']") as HTMLInputElement
  field.value = '-1'
  field.dispatchEvent(new Event('change'))
  const done = editor.addBox(3, 3)
  socket.respond('boxes.box_1.size 3: must be at least 0.001, not -1.0')
  await done
  expect(store.error.value).toBe('The height of box_1 must be at least 0.001, not -1.0.')
  expect(field.value).toBe('0.1')
})

test('Ctrl+Z and Ctrl+Shift+Z undo and redo what there is', () => {
  const { store, socket, editor } = page()
  listenToEditKeys(store, editor, () => {})
  const press = (shiftKey: boolean) =>
    window.dispatchEvent(
      new KeyboardEvent('keydown', { code: 'KeyZ', key: shiftKey ? 'Z' : 'z', ctrlKey: true, shiftKey }),
    )
  press(false)
  expect(socket.of('Request')).toEqual([])
  socket.receive(statusOf({ undo: 'place V1', redo: 'add box_1' }))
  press(false)
  expect(socket.request).toEqual({ type: 'Undo' })
  press(true)
  expect(socket.request).toEqual({ type: 'Redo' })
})

test('the bar and the panel send requests and show the selection', async () => {
  const { store, socket, editor } = page()
  document.body.append(
    ...edit(
      store,
      editor,
      () => null,
      () => save(store, editor),
    ),
  )
  const get = <Element extends HTMLElement>(id: string) =>
    document.querySelector<Element>(`[data-testid="${id}"]`) as Element
  const set = (id: string, value: string) => {
    const field = get<HTMLInputElement>(id)
    field.value = value
    field.dispatchEvent(new Event('change'))
  }
  store.selection.value = 'V1'
  expect(get<HTMLButtonElement>('edit-remove').disabled).toBe(true)
  store.selection.value = 'crate'
  expect(get<HTMLInputElement>('edit-yaw').value).toBe('90')
  get('edit-remove').click()
  expect(socket.request).toEqual({ type: 'RemoveBox', name: 'crate' })
  set('edit-size-z', '0.5')
  get('edit-add').click()
  expect(socket.request).toMatchObject({ type: 'AddBox', name: 'box_1', size: [0.1, 0.1, 0.5], mass: 0.1 })
  const { x, y } = socket.request as unknown as { x: number; y: number }
  expect(Math.hypot(x - 0.07, y)).toBeGreaterThan(0.5 * Math.hypot(0.28, 0.2) + 0.05 * Math.SQRT2) // beside the vehicle
  set('edit-x', '3')
  expect(socket.request).toMatchObject({ type: 'Place', name: 'crate', x: 3 })
  set('lidar-rate', '20')
  const settings = { is_on: true, rate: 20, noise: 'file' }
  expect(socket.request).toEqual({ type: 'SetSensor', vehicle: 'V1', sensor: 'lidar', ...settings })
  socket.receive(statusOf({ undo: 'place V1' }))
  expect(get('edit-undo').title).toBe('Undo: place V1 (Ctrl+Z)')
  store.isEditing.value = false
  expect(get('edit-bar').hidden && get('edit').hidden).toBe(true)
})
