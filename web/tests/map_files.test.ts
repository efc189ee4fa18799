// Maps in links and dropped files: they come back as they were; what was cut or is no map gives a message.
import { afterEach, beforeEach, expect, test, vi } from 'vitest'
import { Actions } from '../src/actions'
import { Builder } from '../src/building/builder'
import { type AskPicture, linkWith, MAX_LINK, openMapFiles, packed, unpacked } from '../src/building/map_files'
import { UserFiles } from '../src/building/user_files'
import { saveMap } from '../src/panels/save_dialog'
import { connectedPage, sceneOf } from './support'

/** The map of 150 modules, at different places. */
const TOWN = `title: Town\nplacements:\n${Array.from(
  { length: 150 },
  (_, i) =>
    `- {name: straight_road_${i}, module: straight_road, x: ${(0.6 * i).toFixed(6)}, y: ${Math.sin(i).toFixed(6)}, yaw_deg: ${(i * 37) % 360}}\n`,
).join('')}`

beforeEach(() => document.body.replaceChildren())
beforeEach(() => history.replaceState(null, '', location.pathname + location.search))
afterEach(() => vi.restoreAllMocks())

function page(mayDiscard = () => Promise.resolve(true)) {
  const it = connectedPage(['V1'])
  const builder = new Builder(it.store, new Actions(it.store, it.connection))
  const use = vi.spyOn(builder, 'use').mockResolvedValue(true)
  const userFiles = new UserFiles(it.store, new Actions(it.store, it.connection))
  const openText = vi.spyOn(userFiles, 'open').mockResolvedValue(true)
  const ask = vi.fn<AskPicture>().mockResolvedValue(true)
  const open = openMapFiles(it.store, builder, userFiles, mayDiscard, ask, (_, apply) => void apply())
  return { ...it, builder, userFiles, use, openText, ask, open }
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

test('a map that is too large for a link is saved as a file', async () => {
  const text = [...crypto.getRandomValues(new Uint8Array(MAX_LINK))].join(' ')
  expect(await linkWith(text)).toBeNull()
  const { store, builder, userFiles } = page()
  vi.spyOn(builder, 'text').mockResolvedValue(text)
  const get = (id: string) => document.querySelector<HTMLElement>(`[data-testid='${id}']`)
  const isSaved = saveMap(store, builder, userFiles, () => Promise.resolve(false))
  ;(get('save-kind') as HTMLSelectElement).value = 'link'
  get('save-map-save')?.click()
  await vi.waitFor(() => expect(get('link-dialog')?.textContent).toContain('too large for a link'))
  get('link-dialog-cancel')?.click()
  expect(await isSaved).toBe(false)
})

test('the name of a file follows the title until the user changes it', async () => {
  const { store, builder, userFiles } = page()
  const isSaved = saveMap(store, builder, userFiles, () => Promise.resolve(false))
  const [title, name] = ['save-title', 'save-name'].map(
    (id) => document.querySelector(`[data-testid='${id}']`) as HTMLInputElement,
  )
  const enter = (field: HTMLInputElement, text: string): void => {
    field.value = text
    field.dispatchEvent(new Event('input'))
  }
  expect(name.value).toBe('my_map')
  enter(title, ' Café, lap 2! ')
  expect(name.value).toBe('caf_lap_2')
  enter(title, '町')
  expect(name.value).toBe('caf_lap_2')
  name.value = 'mine'
  enter(title, 'Yours')
  expect(name.value).toBe('mine')
  document.querySelector<HTMLElement>("[data-testid='save-map-cancel']")?.click()
  expect(await isSaved).toBe(false)
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
  const { store, openText } = page(() => Promise.resolve(false))
  drop(new File([TOWN], 'town.yaml'))
  await vi.waitFor(() => expect(openText).toHaveBeenCalledWith('town.yaml', TOWN))
  await vi.waitFor(() => expect(store.isBuilding.value).toBe(true))
  store.isBuilding.value = false
  drop(new File(['map: oval\nvehicles: {V1: {}}\n'], 'mine.yaml'))
  await vi.waitFor(() => expect(openText).toHaveBeenCalledTimes(2))
  expect(store.isBuilding.value).toBe(false) // a scenario is there to be driven
  openText.mockClear()
  drop(new File(['x'], 'photo.jpg'))
  expect(store.warning.value).toMatch(/photo.jpg is not the YAML file/)
  drop(new File(['x'.repeat(1_100_000)], 'huge.yaml'))
  expect(store.warning.value).toMatch(/1100000 bytes; at most 1048576 are possible/)
  drop(new File(['\n'], 'empty.yaml'))
  await vi.waitFor(() => expect(store.warning.value).toMatch(/empty.yaml is empty/))
  drop(new File(['x'], 'a.yaml'), new File(['y'], 'b.yaml'))
  expect(store.warning.value).toMatch(/one file only/)
  store.hasUnsavedEdits.value = true
  drop(new File([TOWN], 'town.yaml'))
  await new Promise((resolve) => setTimeout(resolve))
  expect(openText).not.toHaveBeenCalled()
  store.hasUnsavedEdits.value = false
})

test('a picture and its YAML file are opened together, or one after the other with a message', async () => {
  const size = { width: 3, height: 2 }
  vi.stubGlobal('createImageBitmap', () => Promise.resolve(size))
  vi.stubGlobal(
    'ImageData',
    class {
      readonly data: Uint8ClampedArray
      constructor(width: number, height: number) {
        this.data = new Uint8ClampedArray(4 * width * height)
      }
    },
  )
  const sheet = (image: string) => new File([`image: ${image}\nresolution: 0.05\norigin: [0, 0, 0]\n`], 'hall.yaml')
  const pgm = new File(['P5\n# made by map_saver\n3 2\n255\nabcdef'], 'hall.pgm')
  const png = new File([new Uint8Array([0x89, 0x50])], 'hall.png')
  const { store, use, ask, open } = page()
  await open([sheet('hall.pgm'), pgm])
  expect(ask.mock.calls[0][0]).toMatchObject({ name: 'hall.pgm', ...size })
  await open([sheet('"maps/hall.png"')])
  expect(store.notice.value).toBe('The file hall.yaml describes the picture hall.png. Drop that picture, too.')
  let seen: string | undefined
  ask.mockImplementation(async (_, found) => {
    seen = found.value?.image
    return true
  })
  await open([png])
  expect(seen).toBe('hall.png')
  await open([png]) // the YAML file was used
  expect(seen).toBeUndefined()
  ask.mockImplementation(async (_, found) => {
    await open([sheet('hall.pgm')])
    seen = found.value?.image
    await open([pgm])
    expect(store.warning.value).toMatch(/Another picture is open/)
    return true
  })
  await open([pgm]) // the YAML file comes while the dialog is open
  expect(seen).toBe('hall.pgm')
  await open([pgm, new File(['placements: []'], 'town.yaml')])
  expect(store.warning.value).toMatch(/town.yaml does not describe a picture/)
  await open([new File(['P5\n3 2\n255\nabc'], 'cut.pgm')])
  expect(store.warning.value).toMatch(/cut.pgm is no PNG or PGM picture, or it is not complete/)
  const random = crypto.getRandomValues(new Uint8Array(60_000))
  const noise = [...Array.from({ length: 20 }, () => random)].map((one, i) => one.map((byte) => byte ^ (i * 37)))
  await open([new File([new Uint8Array([0x89]), ...noise], 'noise.png')])
  expect(store.warning.value).toMatch(/noise.png has 1200001 bytes; at most 1048576 are possible/)
  expect(use).not.toHaveBeenCalled()
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
