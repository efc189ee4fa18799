import { beforeEach, describe, expect, test, vi } from 'vitest'

import { Actions, sentence } from '../src/actions'
import { banner } from '../src/panels/banner'
import { bridge } from '../src/panels/bridge'
import { describeScene } from '../src/panels/description'
import { h } from '../src/panels/element'
import { help } from '../src/panels/help'
import { menu } from '../src/panels/menu'
import { notices } from '../src/panels/notice'
import { savedTheme, setTheme } from '../src/panels/theme'
import { toolbar } from '../src/panels/toolbar'
import { VehicleEvents } from '../src/panels/vehicle_events'
import { Scenarios } from '../src/scenarios'
import {
  connectedPage,
  FakeSocket,
  frameOf,
  newPage,
  pose,
  scanOf,
  sceneOf,
  statusOf,
  vehicleOf,
  welcome,
} from './support'

beforeEach(() => {
  localStorage.clear()
  document.body.replaceChildren()
})

/** The element with that test identifier. */
function get<Kind extends HTMLElement = HTMLElement>(testid: string): Kind {
  const found = document.querySelector<Kind>(`[data-testid='${testid}']`)
  if (!found) throw new Error(`no element '${testid}'`)
  return found
}

function button(parent: HTMLElement, label: string): HTMLButtonElement {
  const found = [...parent.querySelectorAll('button')].find((each) => each.textContent === label)
  if (!found) throw new Error(`no button '${label}'`)
  return found
}

/** Lets resolved promises continue. */
const settle = () => new Promise((done) => setTimeout(done))

describe('the menu', () => {
  function page(vehicles: readonly string[] = ['V1']) {
    const all = connectedPage(vehicles)
    document.body.append(
      menu(
        all.store,
        all.connection,
        new Actions(all.store, all.connection),
        h('section', { testid: 'recording' }),
        () => {},
        new Scenarios(all.store, all.connection, async () => true),
      ),
    )
    return all
  }

  test('a traffic light shows its phase and time to change, and is set or given back to its program', () => {
    const { socket, store } = page()
    const light = { state: 3, time_to_change: 2.4, mode: 'program' as const }
    store.frame.value = frameOf(['V1'], { traffic_lights: { tl: light } })
    expect(get('light-tl-state').textContent).toBe('Green, 3 s')
    const select = get<HTMLSelectElement>('light-tl')
    expect(select.value).toBe('')
    expect([...select.options].map(({ text }) => text)).toEqual(['Program', 'Red', 'Yellow', 'Green', 'Off'])
    select.value = 'RED'
    select.dispatchEvent(new Event('change'))
    expect(socket.request).toEqual({ type: 'SetTrafficLight', light: 'tl', state: 1 })
    store.frame.value = frameOf(['V1'], { traffic_lights: { tl: { state: 1, time_to_change: null, mode: 'set' } } })
    expect(get('light-tl-state').textContent).toBe('Red')
    expect(select.value).toBe('RED')
    select.value = ''
    select.dispatchEvent(new Event('change'))
    expect(socket.request).toEqual({ type: 'SetTrafficLight', light: 'tl', state: null })
  })

  test('a weather is chosen by name, by intensity, and by single amounts', () => {
    const { socket, store } = page()
    const clear = { clouds: 0, fog: 0, rain: 0, snow: 0, wind: 0, wetness: null, snow_cover: null }
    get('weather-heavy_rain').click()
    expect(socket.request).toEqual({ type: 'SetWeather', weather: { ...clear, clouds: 1, rain: 0.8 } })
    const effects = { grip: 0.706, sight: 1186, lidar_dark: 8.65, lidar_bright: 12 }
    const weather = { ...clear, clouds: 1, rain: 0.8, wetness: 1, snow_cover: 0 }
    store.isMenuOpen.value = true
    store.frame.value = frameOf(['V1'], { weather, weather_effects: effects })
    expect(get('weather-numbers').textContent).toBe(
      'Grip of the tyres 0.71 of that on dry ground, LIDAR 8.7 m at 10 % and 12.0 m at 80 % reflectivity, sight more than 1000 m, wetness 100 %',
    )
    expect(socket.request).toEqual({ type: 'DescribeWeather' })
    expect(get('weather-heavy_rain').getAttribute('aria-pressed')).toBe('true')
    expect(get('weather-sunny').getAttribute('aria-pressed')).toBe('false')
    const intensity = get<HTMLInputElement>('weather-intensity')
    expect(intensity.getAttribute('aria-valuetext')).toBe('100 %')
    intensity.value = '0.5'
    intensity.dispatchEvent(new Event('input'))
    const half = { ...clear, clouds: 0.5, rain: 0.4 }
    expect(socket.request).toEqual({ type: 'SetWeather', weather: half, keeps_ground: true })
    const wind = get<HTMLInputElement>('weather-wind')
    wind.value = '1'
    wind.dispatchEvent(new Event('input'))
    expect(socket.request).toMatchObject({ type: 'SetWeather', weather: { wind: 1, rain: 0.4 }, keeps_ground: true })
  })

  test('the time of day is a dial with keys, that says its time', () => {
    const { socket, store } = page()
    const clock = get('time-of-day')
    const press = (key: string) => clock.dispatchEvent(new KeyboardEvent('keydown', { key }))
    press('ArrowRight')
    expect(socket.request).toEqual({ type: 'SetTimeOfDay', time: 43500 })
    press('PageDown')
    expect(socket.request).toEqual({ type: 'SetTimeOfDay', time: 39900 })
    press('Home')
    press('ArrowLeft')
    expect(socket.request).toEqual({ type: 'SetTimeOfDay', time: 86100 })
    expect(clock.getAttribute('aria-valuetext')).toBe('23:55')
    vi.spyOn(performance, 'now').mockReturnValue(performance.now() + 1000)
    store.frame.value = frameOf(['V1'], { time_of_day: 66600 })
    expect(clock.getAttribute('aria-valuetext')).toBe('18:30')
    expect(get('time-of-day-text').textContent).toBe('18:30')
    store.frame.value = frameOf(['V1'], { time_of_day: null })
    expect(get('time-of-day-text').textContent).toBe('Day')
    store.frame.value = frameOf(['V1'], { time_of_day: null, scene_light: false })
    expect(get('time-of-day-text').textContent).toBe('Night')
    expect(get('time-of-day').title).toContain('a fixed light')
    store.frame.value = frameOf(['V1'], { time_of_day: 66600 })
    expect(get('weather-numbers').textContent).toContain('Clear')
    vi.restoreAllMocks()
  })

  test('the time of day passes at a speed, which is that of the simulator', () => {
    const { socket, store } = page()
    const button = (value: string) => get('day-speed').querySelector<HTMLButtonElement>(`[value="${value}"]`)
    button('600')?.click()
    expect(socket.request).toEqual({ type: 'SetTimeOfDay', time: null, scale: 600 })
    for (let time = 0; time < 3; time += 0.25)
      store.frame.value = frameOf(['V1'], { time, time_of_day: (86000 + 3600 * time) % 86400 })
    expect(button('3600')?.getAttribute('aria-pressed')).toBe('true')
    for (let time = 3; time < 5; time += 0.25) store.frame.value = frameOf(['V1'], { time })
    expect(button('0')?.getAttribute('aria-pressed')).toBe('true')
  })

  test('has three tabs; arrow keys go to the next, and the choice is kept', () => {
    page()
    const shown = () => [...document.querySelectorAll<HTMLElement>('[role=tabpanel]')].filter(({ hidden }) => !hidden)
    const has = (testid: string) => shown().some((panel) => panel.contains(get(testid)))
    expect([...get('menu-tab').children].map(({ textContent }) => textContent)).toEqual([
      'Scenario',
      'View and tools',
      'Programs',
    ])
    expect(['scenario', 'weather', 'speed', 'theme', 'ip'].map(has)).toEqual([true, true, true, false, false])
    const press = (testid: string, key: string) =>
      get(testid).dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }))
    press('menu-tab-scenario', 'ArrowLeft')
    expect(document.activeElement).toBe(get('menu-tab-programs'))
    expect(['scenario', 'theme', 'ip'].map(has)).toEqual([false, false, true])
    press('menu-tab-programs', 'ArrowLeft')
    expect(['theme', 'recording', 'camera'].map(has)).toEqual([true, true, true])
    document.body.replaceChildren()
    page()
    expect(has('theme')).toBe(true)
  })

  test('a replay shows the tab that acts on it only', () => {
    const { socket } = page()
    socket.receive(statusOf({ position: 0 }))
    expect(get('menu-tab').hidden).toBe(true)
    expect(get('theme').closest<HTMLElement>('[role=tabpanel]')?.hidden).toBe(false)
    expect(get('scenario').closest<HTMLElement>('[role=tabpanel]')?.hidden).toBe(true)
  })

  test.each([
    ['reset', { type: 'Reset' }],
    ['scene-light', { type: 'SetSceneLight', enabled: false }],
    ['mode', { type: 'SetDrivingMode', vehicle: 'V1', is_autonomous: true }],
    ['pause', { type: 'Pause' }],
  ])('%s sends its request', (testid, request) => {
    const { socket } = page()
    get(testid).click()
    expect(socket.request).toEqual(request)
  })

  test.each([
    ['¼', 0.25],
    ['½', 0.5],
    ['1', 1],
    ['2', 2],
    ['4', 4],
    ['Max', null],
  ])('speed %s is requested, and pressed when it is reported', (label, factor) => {
    const { socket } = page()
    const speed = button(get('speed'), label)
    speed.click()
    expect(socket.request).toEqual({ type: 'SetSpeed', factor })
    socket.receive(statusOf({ speed: factor }))
    expect(get('speed').querySelectorAll('[aria-pressed=true]').length).toBe(1)
    expect(speed.getAttribute('aria-pressed')).toBe('true')
  })

  test('states are those of the simulator, also if another client changes them', () => {
    const { socket } = page()
    socket.receive(
      frameOf([], { time: 3661, scene_light: false, vehicles: { V1: vehicleOf({ is_autonomous: true }) } }),
    )
    socket.receive(statusOf({ is_paused: true }))
    expect(get('scene-light-status').textContent).toBe('Off')
    expect(get('mode-status').textContent).toBe('Autonomous')
    expect(get('mode').getAttribute('aria-pressed')).toBe('true')
    expect(get('time').textContent).toBe('01:01:01')
    expect(get('pause').textContent).toBe('Resume')
    get('pause').click()
    expect(socket.request).toEqual({ type: 'Resume' })
    get('scene-light').click()
    expect(socket.request).toEqual({ type: 'SetSceneLight', enabled: true })
  })

  test('a step pauses first, and has the number of ticks of the field', async () => {
    const { socket } = page()
    get<HTMLInputElement>('ticks').value = '7'
    get('step').click()
    expect(socket.request).toEqual({ type: 'Pause' })
    socket.respond(frameOf())
    await settle()
    expect(socket.request).toEqual({ type: 'Step', ticks: 7 })
  })

  test.each(['', '0', '-3', '2.6', '1e3', '10001', 'ten'])('a step of %j ticks is refused with the reason', (text) => {
    const { socket } = page()
    get<HTMLInputElement>('ticks').value = text
    get('step').click()
    expect(socket.of('Request')).toEqual([])
    expect(get('ticks-error').textContent).toBe('Enter a whole number of ticks from 1 to 10000.')
    expect(get('ticks').getAttribute('aria-invalid')).toBe('true')
    get<HTMLInputElement>('ticks').value = '10000'
    get('ticks').dispatchEvent(new Event('input'))
    expect(get('ticks-error').hidden).toBe(true)
    get('ticks').dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter' }))
    expect(socket.request).toEqual({ type: 'Pause' })
  })

  test('the camera button goes through all cameras', () => {
    const { store } = page()
    const seen = [0, 1, 2, 3, 4].map(() => {
      get('camera').click()
      expect(get('camera-status').textContent).toBe(store.camera.value)
      return store.camera.value
    })
    expect(seen).toEqual(["Bird's Eye", "God's Eye", 'Orbit', 'Fly', "Driver's Eye"])
  })

  test('vehicles can be selected if there are several', () => {
    const { store, socket } = page()
    const select = get<HTMLSelectElement>('vehicle')
    expect(select.closest('label')?.hidden).toBe(true)
    socket.receive(sceneOf(['V1', 'V2'], 'two_cars'))
    expect(select.closest('label')?.hidden).toBe(false)
    select.value = 'V2'
    select.dispatchEvent(new Event('change'))
    expect(store.vehicle.value).toBe('V2')
    store.vehicle.value = 'V1'
    expect(select.value).toBe('V1')
  })

  test('a scenario is loaded, with a note meanwhile and an error in its place', async () => {
    const { socket } = page()
    const select = get<HTMLSelectElement>('scenario')
    expect([...select.options].map((option) => option.value)).toEqual(['plane', 'two_cars'])
    select.value = 'two_cars'
    select.dispatchEvent(new Event('change'))
    expect(socket.request).toEqual({ type: 'LoadScenario', name: 'two_cars' })
    expect(select.disabled).toBe(true)
    expect(get('note').textContent).toBe('Loading Two cars…')
    socket.respond('out of memory')
    await settle()
    expect(get('scenario-error').textContent).toBe('Out of memory.')
    expect(select.disabled).toBe(false)
    expect(select.value).toBe('plane')
    expect(get('note').hidden).toBe(true)
  })

  test('a scenario that is not in the list of the server is shown by its title', () => {
    const { socket } = page()
    socket.receive({ ...sceneOf(['V1'], 'my_file'), title: 'My own' })
    expect(get<HTMLSelectElement>('scenario').selectedOptions[0].textContent).toBe('My own')
    socket.receive({ ...sceneOf(['V1'], '/home/me/my_race.yaml'), title: '' })
    expect(get<HTMLSelectElement>('scenario').selectedOptions[0].textContent).toBe('my_race')
  })

  test('quality and scan are chosen', () => {
    const { store } = page()
    const quality = get<HTMLSelectElement>('quality')
    expect([...quality.options].map((option) => option.value)).toEqual(['auto', 'low', 'high', 'ultra', 'stream'])
    quality.value = 'ultra'
    quality.dispatchEvent(new Event('change'))
    expect(store.quality.value).toBe('ultra')
    store.quality.value = 'low'
    expect(quality.value).toBe('low')
    get<HTMLInputElement>('lidar').click()
    expect(store.isScanShown.value).toBe(false)
  })

  test('the theme is chosen and saved', () => {
    page()
    button(get('theme'), 'Dark').click()
    expect(document.documentElement.dataset.theme).toBe('dark')
    expect(savedTheme()).toBe('dark')
    setTheme('system')
    expect(document.documentElement.dataset.theme).toBeUndefined()
    expect(savedTheme()).toBe('system')
  })

  test('a browser without storage keeps the theme for the page', () => {
    vi.spyOn(Storage.prototype, 'setItem').mockImplementation(() => {
      throw new Error('disabled')
    })
    setTheme('light')
    expect(document.documentElement.dataset.theme).toBe('light')
    setTheme('system')
  })
})

test('before there is a scene, the menu names no scenario', () => {
  const { store, connection } = newPage()
  FakeSocket.latest.open()
  FakeSocket.latest.receive(welcome())
  const scenarios = new Scenarios(store, connection, async () => true)
  document.body.append(menu(store, connection, new Actions(store, connection), h('div'), () => {}, scenarios))
  const select = get<HTMLSelectElement>('scenario')
  expect([select.selectedOptions[0].textContent, select.disabled]).toEqual(['Loading…', true])
  FakeSocket.latest.receive({ ...sceneOf(['V1']), scenario: 'two_cars', title: 'Two cars' })
  expect([select.selectedOptions[0].textContent, select.disabled]).toEqual(['Two cars', false])
})

describe('the bridge', () => {
  function page() {
    const all = connectedPage()
    document.body.append(bridge(all.store, all.connection, () => {}))
    const submit = (host: string, port: string) => {
      get<HTMLInputElement>('ip').value = host
      get<HTMLInputElement>('port').value = port
      for (const name of ['ip', 'port']) get(name).dispatchEvent(new Event('input'))
      get('ip')
        .closest('form')
        ?.dispatchEvent(new Event('submit', { cancelable: true }))
    }
    return { ...all, submit }
  }

  test.each([
    ['', '4567', 'ip', 'The IP address is empty'],
    ['http://10.0.0.1', '4567', 'ip', 'Enter only the address'],
    ['10.0.0.1:80', '4567', 'ip', 'Enter only the address'],
    ['127.0.0.1', '', 'port', 'The port must be a number'],
    ['127.0.0.1', '4567a', 'port', 'The port must be a number'],
    ['127.0.0.1', '0', 'port', 'Port 0 is out of range'],
    ['127.0.0.1', '65536', 'port', 'Port 65536 is out of range'],
  ])('address %j and port %j are refused', (host, port, field, message) => {
    const { socket, submit } = page()
    submit(host, port)
    expect(socket.of('Request')).toEqual([])
    expect(get('bridge-error').hidden).toBe(false)
    expect(get('bridge-error').textContent).toContain(message)
    expect(get(field).getAttribute('aria-invalid')).toBe('true')
    expect(document.activeElement).toBe(get(field))
    get(field).dispatchEvent(new Event('input'))
    expect(get('bridge-error').hidden).toBe(true)
    expect(get(field).getAttribute('aria-invalid')).toBe('false')
  })

  test.each(['127.0.0.1', '::1', '[fe80::1]', 'lab.example.org'])('%s is an address', (host) => {
    const { socket, submit } = page()
    submit(` ${host} `, '4568')
    expect(socket.request).toEqual({ type: 'ConnectBridge', host, port: 4568 })
  })

  test('shows the state of the connection, and the error of the simulator', () => {
    const { socket } = page()
    const state = (state: 'closed' | 'connecting' | 'connected', error = '') => {
      const { bridge } = statusOf()
      socket.receive(statusOf({ bridge: { ...bridge, address: '[::1]:4568', state, error } }))
    }
    state('connecting', 'nothing listens on port 4568')
    expect(get('bridge-status').textContent).toBe('Connecting…')
    expect(get('bridge-error').textContent).toBe('Nothing listens on port 4568.')
    expect([get<HTMLInputElement>('ip').value, get<HTMLInputElement>('port').value]).toEqual(['[::1]', '4568'])
    expect(get<HTMLInputElement>('ip').disabled).toBe(true)
    expect(get<HTMLButtonElement>('connect').disabled).toBe(true)
    state('connected', 'old')
    expect(get('bridge-status').textContent).toBe('Connected')
    expect(get('bridge-error').hidden).toBe(true)
    get('disconnect').click()
    expect(socket.request).toEqual({ type: 'DisconnectBridge' })
    state('closed')
    expect(get('disconnect').hidden).toBe(true)
    expect(get<HTMLButtonElement>('connect').disabled).toBe(false)
  })

  test('is one line that opens, by itself when a script connects', () => {
    const { socket } = page()
    const line = get<HTMLDetailsElement>('bridge')
    expect(line.open).toBe(false)
    const { bridge } = statusOf()
    socket.receive(statusOf({ bridge: { ...bridge, state: 'connecting' } }))
    expect(line.open).toBe(true)
  })

  test('a refused request is shown', async () => {
    const { socket, submit } = page()
    submit('10.0.0.1', '4567')
    socket.respond('this simulator has no bridge')
    await settle()
    expect(get('bridge-error').textContent).toBe('This simulator has no bridge.')
  })

  test('a reset restores the default address', () => {
    const { store, submit } = page()
    submit('10.0.0.1', 'x')
    store.resets.value += 1
    expect([get<HTMLInputElement>('ip').value, get<HTMLInputElement>('port').value]).toEqual(['127.0.0.1', '4567'])
    expect(get('bridge-error').hidden).toBe(true)
  })
})

describe('notices', () => {
  const position = new Float64Array(3)
  const hit = (vehicle: string) => ({
    type: 'Collision' as const,
    time: 0,
    vehicle,
    other: 'wall',
    impulse: 1,
    position,
  })

  function page() {
    vi.useFakeTimers()
    const { store } = connectedPage()
    document.body.append(notices(store))
    const texts = () => [...get('notices').children].map((each) => each.textContent)
    return { store, texts }
  }
  beforeEach(() => () => vi.useRealTimers())

  test('events are described, and repeated ones are counted', () => {
    const { store, texts } = page()
    store.events.value = [hit('V1'), hit('V2')]
    store.events.value = [hit('V1')]
    expect(texts()).toEqual(['V1 hit the wall× 2', 'V2 hit the wall'])
    store.events.value = [{ type: 'OffRoad', time: 0, vehicle: 'V1', position }]
    expect(texts().at(-1)).toBe('V1 left the road')
  })

  test('a notice ends after five seconds, and a repetition prolongs it', () => {
    const { store, texts } = page()
    store.notice.value = 'somebody drives'
    vi.advanceTimersByTime(4000)
    store.notice.value = 'somebody drives'
    vi.advanceTimersByTime(4000)
    expect(texts()).toEqual(['Somebody drives.'])
    vi.advanceTimersByTime(1000)
    expect(texts()).toEqual([])
  })

  test('at most three are shown', () => {
    const { store, texts } = page()
    for (const text of ['one', 'two', 'three', 'four']) store.notice.value = text
    expect(texts()).toEqual(['Two.', 'Three.', 'Four.'])
  })
})

describe('an error', () => {
  test('stays until it is closed, and its command can be copied', async () => {
    vi.useFakeTimers()
    const { store } = connectedPage()
    document.body.append(notices(store))
    const copied = vi.fn(async () => {})
    vi.stubGlobal('navigator', { clipboard: { writeText: copied } })
    store.error.value = "recording needs zstandard: pip install 'autodrive-simulator[recording]'"
    for (const text of ['one', 'two', 'three', 'four']) store.notice.value = text
    vi.advanceTimersByTime(60_000)
    expect(document.querySelectorAll('.notice').length).toBe(1)
    get('notice-copy').click()
    expect(copied).toHaveBeenCalledWith("pip install 'autodrive-simulator[recording]'")
    await vi.waitFor(() => expect(get('notice-copy').textContent).toBe('Copied'))
    vi.advanceTimersByTime(2000)
    expect(get('notice-copy').textContent).toBe('Copy')
    get('notice-close').click()
    expect(document.querySelectorAll('.notice').length).toBe(0)
    store.error.value = 'no command here: nothing to copy'
    expect(document.querySelector("[data-testid='notice-copy']")).toBeNull()
    vi.unstubAllGlobals()
    vi.useRealTimers()
  })
})

describe('the bar', () => {
  function page() {
    const all = connectedPage()
    const record = h('button', { testid: 'record-button' })
    document.body.append(toolbar(all.store, new Actions(all.store, all.connection), record, () => {}))
    return all
  }

  test('its buttons open and close the panels', () => {
    const { store } = page()
    for (const [name, isOpen] of [
      ['menu', store.isMenuOpen],
      ['hud', store.isHudOpen],
    ] as const) {
      expect(isOpen.value).toBe(false)
      get(`${name}-button`).click()
      expect(isOpen.value).toBe(true)
      expect(get(`${name}-button`).getAttribute('aria-expanded')).toBe('true')
      get(`${name}-button`).click()
      expect(get(`${name}-button`).getAttribute('aria-expanded')).toBe('false')
    }
  })

  test('shows speed and gear, driving mode, camera and weather, and sends what is pressed', () => {
    const { store, socket } = page()
    const vehicle = vehicleOf({ velocity: new Float64Array([-0.417, 0, 0]), is_autonomous: true })
    const rain = { clouds: 1, fog: 0, rain: 0.8, snow: 0, wind: 0, wetness: null, snow_cover: null }
    store.frame.value = frameOf([], { vehicles: { V1: vehicle }, weather: rain })
    const texts = ['bar-speed', 'bar-mode', 'bar-camera'].map((name) => get(name).textContent)
    expect(texts).toEqual(['0.42 m/s', 'Autonomous', "Driver's Eye"])
    const weather = get<HTMLSelectElement>('bar-weather')
    expect(weather.selectedOptions[0].textContent).toBe('Heavy rain')
    store.frame.value = frameOf([], { vehicles: { V1: vehicle }, weather: { ...rain, rain: 0.123 } })
    expect(weather.selectedOptions[0].textContent).toBe('Mixed')
    weather.value = 'light_snow'
    weather.dispatchEvent(new Event('change'))
    expect(socket.request).toMatchObject({ type: 'SetWeather', weather: { snow: 0.3 } })
    get('bar-mode').click()
    expect(socket.request).toEqual({ type: 'SetDrivingMode', vehicle: 'V1', is_autonomous: false })
    get('bar-reset').click()
    expect(socket.request).toEqual({ type: 'Reset' })
    get('bar-camera').click()
    expect(store.camera.value).toBe("Bird's Eye")
  })

  test('says that the simulation is paused', () => {
    const { socket } = page()
    socket.receive(statusOf())
    expect(get('paused').hidden).toBe(true)
    socket.receive(statusOf({ is_paused: true }))
    expect(get('paused').hidden).toBe(false)
  })
})

describe('the banner while it connects', () => {
  test('the banner is hidden while the connection is open, and late at the first attempt', () => {
    vi.useFakeTimers()
    const { store, connection } = connectedPage()
    document.body.append(banner(store, new Actions(store, connection)))
    expect(get('banner').hidden).toBe(true)
    store.connectionError.value = 'no answer'
    store.link.value = 'lost'
    expect(get('banner').hidden).toBe(false)
    expect(get('banner').textContent).toContain('No answer. The page tries to connect again.')
    store.link.value = 'open'
    store.link.value = 'connecting'
    vi.advanceTimersByTime(399)
    expect(get('banner').hidden).toBe(true)
    vi.advanceTimersByTime(1)
    expect(get('banner').hidden).toBe(false)
    vi.useRealTimers()
  })
})

describe('the banner', () => {
  test('says what the simulator does while it starts', () => {
    const { store, connection, socket } = connectedPage()
    document.body.append(banner(store, new Actions(store, connection)))
    const bar = get('starting') as HTMLProgressElement
    const unknown = { share: null, remaining: null, scene: null, frame: null, scenario: '', has_start_screen: false }
    socket.receive({ type: 'Starting', stage: 'loading the world', ...unknown })
    expect(get('banner').hidden).toBe(false)
    expect(get('banner').textContent).toContain('Loading the world.')
    expect(bar.hasAttribute('value')).toBe(false)
    socket.receive({ type: 'Starting', stage: 'compiling', ...unknown, share: 0.25, remaining: 62 })
    expect(get('banner').textContent).toContain('Compiling: about a minute left.')
    expect([bar.hidden, bar.value, get('banner-reset').hidden]).toEqual([false, 0.25, true])
    socket.receive(welcome())
    expect([get('banner').hidden, bar.hidden]).toEqual([true, true])
  })

  test('says why the physics cannot go on and offers a Reset', () => {
    const { store, connection, socket } = connectedPage()
    document.body.append(banner(store, new Actions(store, connection)))
    socket.receive(statusOf({ is_paused: true, error: 'the physics became unstable at 1.000 s' }))
    expect(get('banner').hidden).toBe(false)
    expect(get('banner').textContent).toContain('The physics became unstable at 1.000 s.')
    get('banner-reset').click()
    expect(socket.request).toEqual({ type: 'Reset' })
    socket.receive(statusOf())
    expect(get('banner').hidden).toBe(true)
  })
})

describe('the scene in words', () => {
  test('says where the vehicle is, how it drives, and what is near', () => {
    const { store, socket } = connectedPage(['V1'])
    const vehicle = vehicleOf({ pose: pose(1.25), velocity: new Float64Array([-0.3, 0, 0]) })
    socket.receive(frameOf([], { vehicles: { V1: vehicle } }))
    store.scans.set('V1', scanOf([3, 0.5, 2, 4]))
    expect(describeScene(store, new VehicleEvents())).toBe(
      "V1 drives in reverse at 0.30 m/s at x 1.25 m, y 0.00 m, heading 0 degrees; on the road; nearest obstacle 0.50 m, 90 degrees to the left; day, camera Driver's Eye.",
    )
    store.link.value = 'lost'
    expect(describeScene(store, new VehicleEvents())).toBe('The connection to the simulator is lost.')
  })
})

test('a page of another version offers to reload, whatever the connection does', () => {
  const { store, connection, socket } = connectedPage()
  document.body.append(banner(store, new Actions(store, connection)))
  expect(get('banner-reload').hidden).toBe(true)
  const text = 'this simulator speaks version 3 of the native protocol, not 2'
  socket.receive({ type: 'Error', code: 'version', text, id: null })
  socket.close()
  expect(get('banner').hidden).toBe(false)
  expect(get('banner').textContent).toContain('This simulator speaks version 3')
  expect(get('banner-reload').hidden).toBe(false)
  expect(get('banner-reset').hidden).toBe(true)
  store.link.value = 'open'
  expect(get('banner').hidden).toBe(false)
})

describe('the help', () => {
  test('opens and closes, and lists every key', () => {
    const { element, toggle } = help(() => {})
    document.body.append(element)
    toggle()
    expect(element.open).toBe(true)
    expect(element.textContent).toContain('Drive forward')
    expect(element.textContent).toContain('Shift')
    element.dispatchEvent(new KeyboardEvent('keydown', { key: '?' }))
    expect(element.open).toBe(false)
    toggle()
    get('help-close').click()
    expect(element.open).toBe(false)
  })
})

describe('actions', () => {
  test('the error of a request is a notice', async () => {
    const { store, connection, socket } = connectedPage()
    const done = new Actions(store, connection).reset()
    socket.respond('not while loading')
    await done
    expect(store.error.value).toBe('Not while loading.')
    expect(store.resets.value).toBe(0)
  })

  test('vehicles are selected in turn', () => {
    const { store, connection } = connectedPage(['V1', 'V2'])
    const actions = new Actions(store, connection)
    actions.nextVehicle()
    expect(store.vehicle.value).toBe('V2')
    actions.nextVehicle()
    expect(store.vehicle.value).toBe('V1')
  })

  test('messages become sentences', () => {
    expect(sentence(new Error('a'))).toBe('A.')
    expect(sentence('Is it?')).toBe('Is it?')
    expect(sentence('done (twice)')).toBe('Done (twice)')
  })
})

test('attributes of elements follow HTML', () => {
  const press = vi.fn()
  const element = h(
    'button',
    { testid: 'x', disabled: false, hidden: true, title: null, onclick: press },
    'a',
    null,
    'b',
  )
  expect(element.outerHTML).toBe('<button data-testid="x" hidden="">ab</button>')
  element.click()
  expect(press).toHaveBeenCalledOnce()
})
