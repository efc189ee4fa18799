// Maps in links and dropped files: they come back as they were; what was cut or is no map gives a message.
import { afterEach, beforeEach, expect, test, vi } from 'vitest'
import { Actions } from '../src/actions'
import { Builder } from '../src/building/builder'
import { linkWith, MAX_LINK, openMapFiles, packed, unpacked } from '../src/building/map_files'
import { connectedPage, sceneOf } from './support'

/** The map of 150 modules, at different places. */
const TOWN = `title: Town\nplacements:\n${Array.from(
  { length: 150 },
  (_, i) =>
    `- {name: straight_road_${i}, module: straight_road, x: ${(0.6 * i).toFixed(6)}, y: ${Math.sin(i).toFixed(6)}, yaw_deg: ${(i * 37) % 360}}\n`,
).join('')}`

beforeEach(() => history.replaceState(null, '', location.pathname + location.search))
afterEach(() => vi.restoreAllMocks())

function page(mayDiscard = () => Promise.resolve(true)) {
  const it = connectedPage(['V1'])
  const builder = new Builder(it.store, new Actions(it.store, it.connection))
  const use = vi.spyOn(builder, 'use').mockResolvedValue(true)
  openMapFiles(it.store, builder, mayDiscard)
  return { ...it, use }
}

function drop(...files: File[]): void {
  const event = new Event('drop', { cancelable: true })
  Object.assign(event, { dataTransfer: { files, types: ['Files'] } })
  window.dispatchEvent(event)
}

test('a map of 150 modules fits into a link and comes back', async () => {
  const link = await linkWith(TOWN)
  expect(link?.length).toBeLessThan(MAX_LINK)
  expect(link).toMatch(/#own_map=[\w.-]+$/)
  expect(await unpacked(link?.split('=')[1] ?? '')).toBe(TOWN)
  expect(await unpacked(await packed('title: Ä €'))).toBe('title: Ä €')
})

test('a link that was cut or changed gives nothing', async () => {
  const value = await packed(TOWN)
  for (const part of [value.slice(0, value.length / 2), value.slice(4), '', '!'])
    expect(await unpacked(part)).toBeNull()
  expect(await unpacked(await packed('a'.repeat(10_000_000)))).toBeNull()
})

test('the map of a link is opened once the simulator has a scene; a cut link says so', async () => {
  location.hash = `own_map=${await packed(TOWN)}`
  const { store, socket, use } = page()
  socket.receive(sceneOf(['V1']))
  await vi.waitFor(() => expect(use).toHaveBeenCalledWith({ text: TOWN }))
  await vi.waitFor(() => expect(store.isBuilding.value).toBe(true))
  location.hash = `own_map=${(await packed(TOWN)).slice(0, 200)}`
  const other = page()
  other.socket.receive(sceneOf(['V1']))
  await vi.waitFor(() => expect(other.store.warning.value).toMatch(/link was cut/))
  expect(other.use).not.toHaveBeenCalled()
})

test('a file that is dropped is opened, unless it is no map or edits would be lost', async () => {
  const { store, use } = page(() => Promise.resolve(false))
  drop(new File([TOWN], 'town.yaml'))
  await vi.waitFor(() => expect(use).toHaveBeenCalledWith({ text: TOWN }))
  use.mockClear()
  drop(new File(['x'], 'photo.jpg'))
  expect(store.warning.value).toMatch(/photo.jpg is not the YAML file/)
  drop(new File(['x'.repeat(70_000)], 'huge.yaml'))
  expect(store.warning.value).toMatch(/70000 bytes; a map has at most 60000/)
  drop(new File(['x'], 'a.yaml'), new File(['y'], 'b.yaml'))
  expect(store.warning.value).toMatch(/one file only/)
  store.hasUnsavedEdits.value = true
  drop(new File([TOWN], 'town.yaml'))
  await new Promise((resolve) => setTimeout(resolve))
  expect(use).not.toHaveBeenCalled()
  store.hasUnsavedEdits.value = false
})

test('the browser asks before unsaved edits are lost', () => {
  const { store } = page()
  const leave = (): boolean => window.dispatchEvent(new Event('beforeunload', { cancelable: true }))
  store.hasUnsavedEdits.value = false
  expect(leave()).toBe(true)
  store.hasUnsavedEdits.value = true
  expect(leave()).toBe(false)
  store.hasUnsavedEdits.value = false
})
