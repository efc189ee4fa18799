import { beforeEach, describe, expect, test, vi } from 'vitest'

import { Actions } from '../src/actions'
import { logOf } from '../src/log'
import { WEATHERS } from '../src/messages'
import { logPanel } from '../src/panels/log'
import { measure } from '../src/panels/measure'
import { tools } from '../src/panels/tools'
import type { SceneView } from '../src/scene/view'
import { Store } from '../src/store'
import { TRAIL_POINTS, Trails } from '../src/trails'
import { hasSeveralVehicles, vehicleColour } from '../src/vehicle_colours'
import { followViewInLink } from '../src/view_link'
import { connectedPage, FakeSocket, frameOf, pose, sceneOf, statusOf, vehicleOf } from './support'

beforeEach(() => {
  document.body.replaceChildren()
  history.replaceState(null, '', location.pathname + location.search)
})

describe('the link', () => {
  let proposed: string[] = []
  function pageAt(hash: string): Store {
    vi.useFakeTimers()
    proposed = []
    history.replaceState(null, '', location.pathname + location.search + hash)
    const { store, connection } = connectedPage(['V1', 'V2'])
    followViewInLink(store, new Actions(store, connection), (what, apply) => {
      proposed.push(what)
      void apply()
    })
    vi.advanceTimersByTime(1000)
    return store
  }
  const requests = () => FakeSocket.latest.sent.flatMap((one) => (one.type === 'Request' ? [one.operation] : []))
  beforeEach(() => () => vi.useRealTimers())

  test('of the standard view has no fragment', () => {
    pageAt('')
    expect(location.hash).toBe('')
  })

  test('proposes weather and time of day once, then follows the simulator', () => {
    const store = pageAt('#weather=rain:0.4,wind:1&time=18:30')
    expect(proposed).toEqual(['Weather: rain:0.4,wind:1', 'Time of day: 18:30'])
    const sent = requests()
    const clear = { clouds: 0, fog: 0, rain: 0, snow: 0, wind: 0, wetness: null, snow_cover: null }
    expect(sent).toContainEqual({ type: 'SetWeather', weather: { ...clear, rain: 0.4, wind: 1 } })
    expect(sent).toContainEqual({ type: 'SetTimeOfDay', time: 66600 })
    const count = sent.length
    store.frame.value = frameOf(['V1', 'V2'], { weather: WEATHERS.heavy_fog, time_of_day: 3900 })
    vi.advanceTimersByTime(1000)
    expect(location.hash).toBe('#weather=heavy_fog&time=01:05')
    store.frame.value = frameOf(['V1', 'V2'])
    vi.advanceTimersByTime(1000)
    expect(location.hash).toBe('')
    expect(requests().length).toBe(count)
  })

  test('has values within the limits of the page', () => {
    const store = pageAt('#zoom=-1,1e9&height=-3&orbit=0,-40,99')
    expect(store.lensZoom.value).toEqual({ "Driver's Eye": 0.4, "God's Eye": 10 })
    expect(store.birdHeight.value).toBe(1) // the least of the scene
    expect(store.orbit.value?.elevation).toBeCloseTo(0.02)
    expect(store.orbit.value?.distance).toBe(12)
  })

  test('follows a time of day that passes fast', () => {
    const store = pageAt('')
    const replace = vi.spyOn(history, 'replaceState')
    for (let minutes = 600; minutes < 660; minutes++) {
      store.frame.value = frameOf(['V1', 'V2'], { time_of_day: 60 * minutes })
      vi.advanceTimersByTime(250) // 15 s in all
    }
    expect(location.hash).toMatch(/^#time=10:[34]/)
    vi.advanceTimersByTime(10_000)
    expect(location.hash).toBe('#time=10:55')
    expect(replace.mock.calls.length, 'the address stands still while the time passes').toBeLessThanOrEqual(3)
    replace.mockRestore()
  })

  test('stays as it is while the user types or copies the address, and follows afterwards', () => {
    const store = pageAt('')
    const focus = vi.spyOn(document, 'hasFocus').mockReturnValue(false)
    store.camera.value = 'Orbit'
    vi.advanceTimersByTime(60_000)
    expect(location.hash).toBe('')
    focus.mockReturnValue(true)
    window.dispatchEvent(new Event('focus'))
    vi.advanceTimersByTime(1000)
    expect(location.hash).toBe('#camera=orbit')
    focus.mockRestore()
  })

  test.each(['weather=storm', 'weather=rain:2', 'weather=constructor', 'time=noon', 'time=99:99', 'time=12:60'])(
    'ignores %s',
    (text) => {
      pageAt(`#${text}`)
      expect(requests().filter(({ type }) => type.startsWith('Set'))).toEqual([])
    },
  )

  test('holds camera, vehicle, quality and panels, and opens the same view', () => {
    const store = pageAt('')
    store.camera.value = 'Orbit'
    store.orbit.value = { azimuth: Math.PI / 2, elevation: 0.5, distance: 2 }
    store.fly.value = { x: 1, y: -2, z: 0.5, azimuth: Math.PI / 2, elevation: -0.5 }
    store.birdHeight.value = 1.5
    store.lensZoom.value = { "Driver's Eye": 2, "God's Eye": 1 }
    store.vehicle.value = 'V2'
    store.quality.value = 'high'
    store.isHudOpen.value = store.isMapOpen.value = store.areTrailsShown.value = true
    store.isScanShown.value = false
    store.bearing.value = -Math.PI / 4
    vi.advanceTimersByTime(1000)
    const hash = location.hash
    expect(hash).toContain('camera=orbit&')
    expect(hash).toContain('orbit=90,28.648,2')
    const opened = pageAt(hash)
    expect(opened.camera.value).toBe('Orbit')
    expect(opened.orbit.value).toEqual({ azimuth: Math.PI / 2, elevation: expect.closeTo(0.5, 4), distance: 2 })
    expect(opened.fly.value).toEqual({
      ...store.fly.value,
      azimuth: expect.closeTo(Math.PI / 2),
      elevation: expect.closeTo(-0.5, 4),
    })
    expect(opened.birdHeight.value).toBe(1.5)
    expect(opened.lensZoom.value).toEqual({ "Driver's Eye": 2, "God's Eye": 1 })
    expect(opened.vehicle.value).toBe('V2')
    expect(opened.quality.value).toBe('high')
    const { isMenuOpen, isHudOpen, isMapOpen, isLogOpen, areTrailsShown, isScanShown } = opened
    const shown = [isMenuOpen, isHudOpen, isMapOpen, isLogOpen, areTrailsShown, isScanShown].map(({ value }) => value)
    expect(shown).toEqual([false, true, true, false, true, false])
    expect(opened.bearing.value).toBeCloseTo(-Math.PI / 4)
    expect(location.hash).toBe(hash)
  })

  test('without meaning is the standard view', () => {
    const store = pageAt('#camera=none&orbit=1,x&fly=1,2,3,4&height=abc&quality=best&zoom=2&bearing=&hud=yes')
    expect(store.camera.value).toBe("Driver's Eye")
    expect([store.orbit.value, store.fly.value, store.birdHeight.value]).toEqual([null, null, 3])
    expect(store.quality.value).toBe('auto')
    expect([store.bearing.value, store.isHudOpen.value]).toEqual([0, false])
  })

  test('that is typed into the same page changes the view', () => {
    const store = pageAt('#camera=orbit')
    history.replaceState(null, '', '#camera=birds-eye&hud=1')
    window.dispatchEvent(new Event('hashchange'))
    expect([store.camera.value, store.isHudOpen.value]).toEqual(["Bird's Eye", true])
  })

  test('does not hold a quality that the page chose because another one was impossible', () => {
    const store = pageAt('')
    store.fallbackQuality = 'stream'
    store.quality.value = 'stream'
    vi.advanceTimersByTime(1000)
    expect(location.hash).toBe('')
  })
})

describe('the log', () => {
  test('is kept by a reload, up to 200 entries', () => {
    const { store } = connectedPage()
    const entries = logOf(store)
    for (let i = 0; i < 300; i++) store.notice.value = `notice ${i}`
    expect(entries.value.length).toBe(301)
    window.dispatchEvent(new Event('pagehide'))
    const again = logOf(connectedPage().store).value
    expect(again.length).toBe(201)
    expect(again.at(-2)).toEqual(entries.value.at(-1))
    expect(again.at(-1)?.text).toBe('Connected.')
    sessionStorage.setItem('autodrive.log', '{')
    expect(logOf(connectedPage().store).value.map(({ text }) => text)).toEqual(['Connected.'])
    sessionStorage.clear()
  })

  test('keeps notices, warnings, events and errors with their times', () => {
    const { store, socket } = connectedPage()
    const entries = logOf(store)
    document.body.append(logPanel(store, entries))
    socket.receive(frameOf(['V1'], { time: 61 }))
    store.notice.value = 'somebody drives'
    store.warning.value = 'no image'
    const position = new Float64Array(3)
    store.events.value = [{ type: 'OffRoad', time: 60.5, vehicle: 'V1', position }]
    const { bridge } = statusOf()
    for (const _ of [1, 2]) socket.receive(statusOf({ bridge: { ...bridge, state: 'connecting', error: 'refused' } }))
    socket.receive(
      statusOf({ bridge: { ...bridge, state: 'connecting', error: 'refused' }, error: 'V1 is not finite' }),
    )
    store.connectionError.value = 'no answer'
    for (const _ of [1, 2]) store.link.value = 'lost'
    store.link.value = 'open'
    expect(entries.value.map(({ level, time, text }) => [level, time, text])).toEqual([
      ['good', 0, 'Connected.'],
      ['info', 61, 'Somebody drives.'],
      ['warning', 61, 'No image.'],
      ['warning', 60.5, 'V1 left the road'],
      ['error', 61, 'Bridge: Refused.'],
      ['info', 61, 'Bridge: Connecting, 127.0.0.1:4567.'],
      ['error', 61, 'V1 is not finite.'],
      ['error', 61, 'The connection is lost. No answer.'],
      ['good', 61, 'Connected again.'],
    ])
    store.isLogOpen.value = true
    const rows = [...document.querySelectorAll('tbody tr')].map((row) =>
      [...row.children].map((cell) => cell.textContent),
    )
    expect(rows.length).toBe(9)
    expect(rows[2].slice(1)).toEqual(['00:01:01', 'Warning', 'No image.'])
    expect(rows[2][0]).toMatch(/^\d\d:\d\d:\d\d$/)
    store.notice.value = 'another'
    expect(document.querySelectorAll('tbody tr').length).toBe(10)
    document.querySelector<HTMLElement>("[data-testid='log-clear']")?.click()
    expect(document.querySelectorAll('tbody tr').length).toBe(0)
  })

  test('drops the oldest of more than 500 entries', () => {
    const store = new Store()
    const entries = logOf(store)
    for (let i = 0; i < 510; i++) store.notice.value = `number ${i}`
    expect(entries.value.length).toBe(500)
    expect(entries.value[0].text).toBe('Number 10.')
  })

  test('shows checkpoints on demand, and they displace no other entry', () => {
    const store = new Store()
    const entries = logOf(store)
    const panel = logPanel(store, entries)
    const texts = () => [...panel.querySelectorAll('tbody tr')].map((row) => row.lastElementChild?.textContent)
    const button = panel.querySelector<HTMLElement>("[data-testid='log-details']")
    store.isLogOpen.value = true
    const common = { vehicle: 'V1', lap: 1, position: new Float64Array(3) }
    const lap = { type: 'LapCompleted' as const, time: 8, lap_time: 8, is_counted: false, ...common }
    const passed = { type: 'CheckpointPassed' as const, time: 1, checkpoint: 2, split: 1, sector_time: 1, ...common }
    expect(button?.hidden).toBe(true)
    store.events.value = [passed, lap, { ...passed, time: 9, lap: 2 }]
    expect(texts()).toEqual(['V1 completed lap 1 in 0:08.000, a warm-up lap'])
    button?.click()
    expect(button?.getAttribute('aria-pressed')).toBe('true')
    expect(texts()).toEqual([
      'V1 passed checkpoint 2 of lap 1',
      'V1 completed lap 1 in 0:08.000, a warm-up lap',
      'V1 passed checkpoint 2 of lap 2',
    ])
    button?.click()
    for (let i = 0; i < 600; i++) store.events.value = [{ ...passed, time: 10 + i }]
    expect(texts().length).toBe(1)
  })
})

describe('trails', () => {
  const at = (time: number, x: number, speed = 0.2) =>
    frameOf([], { time, vehicles: { V1: vehicleOf({ pose: pose(x), velocity: new Float64Array([speed, 0, 0]) }) } })
  const xs = (trails: Trails) => {
    const { points, length } = trails.all.get('V1') ?? { points: [], length: 0 }
    return Array.from({ length }, (_, i) => points[3 * i])
  }

  test('have a point for each 2 cm of the way, on the ground', () => {
    const trails = new Trails()
    for (let i = 0; i <= 100; i++) trails.add(at(0.01 * i, 0.005 * i), () => 0.03)
    expect(xs(trails).length).toBeGreaterThanOrEqual(0.5 / 0.025)
    expect(xs(trails).length).toBeLessThanOrEqual(0.5 / 0.02 + 1)
    expect(trails.all.get('V1')?.points[2]).toBeCloseTo(-0.03)
  })

  test('have a gap at a jump, but not where Frames are rare', () => {
    const trails = new Trails()
    for (const [time, x] of [
      [0, 0],
      [1, 0.4],
      [1.01, 5],
    ])
      trails.add(at(time, x), () => 0)
    expect(xs(trails)).toEqual([0, expect.closeTo(0.4), NaN, 5])
  })

  test('follow the places between two Frames, and take none that is older than a Frame', () => {
    const trails = new Trails()
    trails.add(at(0, 0), () => 0)
    const ways = {
      type: 'Ways' as const,
      times: new Float64Array([0, 0.5, 1]),
      positions: { V1: new Float64Array([9, 9, 9, 0.2, 0.1, 0, 0.3, 0.2, 0]) },
    }
    trails.addWays(ways, () => 0)
    trails.add(at(1.5, 0.5), () => 0)
    expect(xs(trails)).toEqual([0, 0.2, 0.3, 0.5].map((x) => expect.closeTo(x)))
  })

  test('start again when time goes back, and keep the later half when they are full', () => {
    const trails = new Trails()
    for (let i = 0; i <= TRAIL_POINTS; i++) trails.add(at(0.1 * i, 0.0201 * i), () => 0)
    expect(xs(trails).length).toBe(TRAIL_POINTS / 2 + 1)
    expect(xs(trails).at(-1)).toBeCloseTo(0.0201 * TRAIL_POINTS, 3)
    trails.add(at(0, 1), () => 0)
    expect(xs(trails)).toEqual([1])
  })
})

describe('measuring', () => {
  function page() {
    const { store } = connectedPage()
    const canvas = document.body.appendChild(document.createElement('canvas'))
    const view = {
      groundPoint: (x: number, y: number) => (y < 10 ? null : [x / 100, y / 100]),
      screenPoint: (x: number, y: number) => [100 * x, 100 * y],
    } as unknown as SceneView
    document.body.append(measure(store, canvas, () => view))
    const click = (x: number, y: number, movedBy = 0) => {
      canvas.dispatchEvent(new MouseEvent('pointerdown', { clientX: x, clientY: y }))
      canvas.dispatchEvent(new MouseEvent('pointerup', { clientX: x + movedBy, clientY: y }))
      store.imageCount.value += 1
    }
    const distance = () => document.querySelector("[data-testid='distance']")?.textContent
    return { store, click, distance }
  }

  test('two clicks on the ground give their distance; a third one starts again', () => {
    const { store, click, distance } = page()
    click(100, 100)
    click(400, 500)
    expect(distance()).toBe('') // it is not switched on
    store.isMeasuring.value = true
    click(100, 100)
    click(400, 5) // the sky
    click(300, 100, 50) // a drag
    expect(distance()).toBe('')
    click(400, 500)
    expect(distance()).toBe('5.00 m')
    click(100, 100)
    expect(distance()).toBe('')
    click(100, 150)
    expect(distance()).toBe('0.50 m')
    store.isMeasuring.value = false
    expect(distance()).toBe('')
  })

  test('the keyboard sets points, too', () => {
    const { store, distance } = page()
    store.isMeasuring.value = true
    const cross = document.querySelector<HTMLElement>("[data-testid='measure-cross']")
    const outside = vi.fn()
    window.addEventListener('keydown', outside)
    const press = (key: string, times = 1) => {
      for (let i = 0; i < times; i++) cross?.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }))
    }
    // the canvas of the test has no size, so that the cross stays within 0
    press('Enter')
    expect(distance()).toBe('')
    press('Escape')
    expect(store.isMeasuring.value).toBe(false)
    expect(outside).not.toHaveBeenCalled() // the keys do not drive
    window.removeEventListener('keydown', outside)
  })
})

test('vehicles have different colours', () => {
  const scene = sceneOf(['V1', 'V2', 'V3'])
  expect(new Set(['V1', 'V2', 'V3'].map((name) => vehicleColour(scene, name))).size).toBe(3)
  expect(hasSeveralVehicles(scene)).toBe(true)
  expect(hasSeveralVehicles(sceneOf(['V1']))).toBe(false)
})

test('key V says which vehicle is viewed now', () => {
  const { store, connection } = connectedPage(['V1', 'V2'])
  new Actions(store, connection).nextVehicle()
  expect(store.notice.value).toBe('V2 is viewed now.')
})

test('the buttons of the tools switch their panels', () => {
  const { store, connection } = connectedPage()
  document.body.append(tools(store, new Actions(store, connection)))
  for (const [testid, is] of [
    ['measure-button', store.isMeasuring],
    ['log-button', store.isLogOpen],
    ['minimap-switch', store.isMapOpen],
    ['trails-switch', store.areTrailsShown],
  ] as const) {
    document.querySelector<HTMLElement>(`[data-testid='${testid}']`)?.click()
    expect(is.value, testid).toBe(true)
  }
})
