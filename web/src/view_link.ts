// The view in the link: camera, vehicle, quality and panels are in the fragment of the URL, so that they survive a
// reload, and a copied link shows the same view.
import type { Actions } from './actions'
import { CAMERAS } from './actions'
import type { Weather } from './messages'
import { WEATHERS } from './messages'
import type { Observable } from './observable'
import { clockTime } from './panels/element'
import type { Propose } from './panels/link_changes'
import { clamp } from './scene/clamp'
import { within } from './scene/flight'
import { heightAfter, LENS_ZOOM, ORBIT_DISTANCE, ORBIT_ELEVATION } from './scene/zoom'
import type { Camera, Fly, Orbit, Quality, Store } from './store'

/** Delay after a change [ms]: browsers limit how often a page may change its URL. */
const DELAY = 400
/** Delay after a change that the user has not made, such as the time of day that passes [ms]. */
const LONG_DELAY = 10_000
const DEGREE = Math.PI / 180

const LENSES = ["Driver's Eye", "God's Eye"] as const
const QUALITIES: readonly Quality[] = ['auto', 'low', 'high', 'ultra', 'stream']

/** A part of the view as text; '' is the standard value. */
interface Part {
  read: (text: string) => void
  write: () => string
}

/** Shows the view of the link and proposes its weather and time of day, then keeps the link up to date. */
export function followViewInLink(store: Store, actions: Actions, propose: Propose): void {
  const query = new URLSearchParams(location.search).get('quality')
  if (isQuality(query)) store.quality.value = query
  let timer = 0
  let due = Infinity
  const writeWithin = (delay: number) => {
    if (performance.now() + delay >= due) return // a change that goes on, such as the time of day, is written, too
    window.clearTimeout(timer)
    due = performance.now() + delay
    timer = window.setTimeout(writeUnlessAddressIsUsed, delay)
  }
  const writeSoon = () => writeWithin(DELAY)

  /** A value that is `standard` unless the link says otherwise. `parse` returns undefined for a text without meaning. */
  function part<T>(of: Observable<T>, format: (value: T) => string, parse: (text: string) => T | undefined): Part {
    const standard = of.value
    of.watch(writeSoon)
    return {
      read: (text) => {
        const value = (text && parse(text)) || standard
        if (format(value) !== format(of.value)) of.value = value
      },
      write: () => (format(of.value) === format(standard) ? '' : format(of.value)),
    }
  }

  const flag = (of: Observable<boolean>): Part => {
    const standard = of.value
    of.watch(writeSoon)
    return {
      read: (text) => {
        const value = text === '' ? standard : text === '1'
        if (value !== of.value) of.value = value
      },
      write: () => (of.value === standard ? '' : String(Number(of.value))),
    }
  }

  /** A state of the simulator, which the link proposes once; then the link shows that of the simulator. */
  const state = (
    name: string,
    request: (text: string) => Parameters<Actions['request']>[0] | undefined,
    show: () => string,
  ): Part => {
    let wanted = ''
    let shown = ''
    const follow = () => {
      if (!store.frame.value || store.status.value?.position !== null) return // not yet, or a replay
      const operation = wanted && wanted !== show() && request(wanted)
      if (operation) propose(`${name}: ${wanted}`, () => void actions.request(operation))
      wanted = ''
      if (show() === shown) return
      const isFirst = shown === '' || show() === ''
      shown = show()
      writeWithin(isFirst ? DELAY : LONG_DELAY)
    }
    store.frame.watch(follow)
    return {
      read: (text) => {
        wanted = text
        follow()
      },
      write: () => wanted || shown,
    }
  }

  const quality = part(store.quality, String, (text) => (isQuality(text) ? text : undefined))
  const parts: Record<string, Part> = {
    camera: part(
      store.camera,
      (camera) => slug(camera),
      (text) => CAMERAS.find((camera) => slug(camera) === text),
    ),
    height: part(store.birdHeight, (height) => rounded(height), number),
    zoom: part(
      store.lensZoom,
      (zoom) => LENSES.map((camera) => rounded(zoom[camera])).join(),
      (text) => {
        const [driver, god] = text.split(',').map((one) => number(one))
        if (!driver || !god) return undefined
        return { "Driver's Eye": clamp(driver, LENS_ZOOM), "God's Eye": clamp(god, LENS_ZOOM) }
      },
    ),
    orbit: part(store.orbit, orbitText, orbitOf),
    fly: part(store.fly, flyText, flyOf),
    vehicle: {
      read: (text) => {
        if (text && text !== store.vehicle.value) store.vehicle.value = text
      },
      // the first vehicle is the standard one
      write: () => {
        const [first = ''] = Object.keys(store.scene.value?.vehicles ?? {})
        return store.vehicle.value === first ? '' : store.vehicle.value
      },
    },
    quality: { ...quality, write: () => (store.quality.value === store.fallbackQuality ? '' : quality.write()) },
    menu: flag(store.isMenuOpen),
    hud: flag(store.isHudOpen),
    build: flag(store.isBuilding),
    log: flag(store.isLogOpen),
    map: flag(store.isMapOpen),
    trails: flag(store.areTrailsShown),
    labels: flag(store.areLabelsShown),
    drawings: flag(store.areDrawingsShown),
    shapes: flag(store.areShapesShown),
    forces: flag(store.areForcesShown),
    axes: flag(store.areAxesShown),
    scan: flag(store.isScanShown),
    weather: state(
      'Weather',
      (text) => {
        const weather = weatherOf(text)
        return weather && { type: 'SetWeather', weather }
      },
      () => weatherText(store.frame.value?.weather ?? null),
    ),
    time: state(
      'Time of day',
      (text) => {
        const [, hours, minutes] = /^([01]?\d|2[0-3]):([0-5]\d)$/.exec(text) ?? []
        return hours ? { type: 'SetTimeOfDay', time: 3600 * Number(hours) + 60 * Number(minutes) } : undefined
      },
      () => {
        const time = store.frame.value?.time_of_day ?? null
        return time === null ? '' : clockTime(Math.floor(time / 300) * 5)
      },
    ),
    bearing: part(
      store.bearing,
      (bearing) => String(Math.round(bearing / DEGREE)),
      (text) => scaled(text, DEGREE),
    ),
  }
  store.vehicle.watch(writeSoon)
  function read(): void {
    const view = new URLSearchParams(location.hash.slice(1))
    for (const [name, part] of Object.entries(parts)) part.read(view.get(name) ?? '')
  }

  /** The page has no focus while the user types or copies the address: it stays as it is until then. */
  function writeUnlessAddressIsUsed(): void {
    due = Infinity
    if (document.hasFocus()) write()
    else window.addEventListener('focus', writeSoon, { once: true })
  }

  function write(): void {
    window.clearTimeout(timer)
    due = Infinity
    const view = Object.entries(parts).map(([name, part]) => [name, part.write()])
    const texts = view.filter(([, text]) => text).map(([name, text]) => `${name}=${encodeURIComponent(text)}`)
    const hash = texts.length > 0 ? `#${texts.join('&').replaceAll('%2C', ',').replaceAll('%3A', ':')}` : ''
    if (hash !== location.hash) history.replaceState(history.state, '', location.pathname + location.search + hash)
  }

  read()
  for (const observable of [store.scene, store.birdHeight])
    observable.watch(() => {
      const { scene, birdHeight } = store
      const height = scene.value ? heightAfter(scene.value, birdHeight.value, 0) : birdHeight.value
      if (height !== birdHeight.value) birdHeight.value = height
    })
  window.addEventListener('hashchange', read)
  window.addEventListener('pagehide', write)
}

const AMOUNTS = ['clouds', 'fog', 'rain', 'snow', 'wind'] as const

/** The name of a weather, or its amounts as 'rain:0.4,wind:1'; '' without weather. */
function weatherText(weather: Weather | null): string {
  if (!weather) return ''
  const isSame = (one: Weather) => AMOUNTS.every((name) => Math.abs(one[name] - weather[name]) < 1e-3)
  const [named] = Object.entries(WEATHERS).find(([, one]) => isSame(one)) ?? []
  const amounts = AMOUNTS.filter((name) => weather[name] > 0).map((name) => `${name}:${rounded(weather[name])}`)
  return named ? (named === 'sunny' ? '' : named) : amounts.join()
}

function weatherOf(text: string): Weather | undefined {
  if (Object.hasOwn(WEATHERS, text)) return WEATHERS[text]
  const pairs = text.split(',').map((pair) => pair.split(':') as [(typeof AMOUNTS)[number], string])
  const isValid = pairs.every(([name, amount = '']) => AMOUNTS.includes(name) && /^(0?\.\d+|0|1)$/.test(amount))
  const amounts = pairs.map(([name, amount]) => [name, Number(amount)])
  return isValid ? { ...WEATHERS.sunny, ...Object.fromEntries(amounts) } : undefined
}

function isQuality(text: string | null): text is Quality {
  return QUALITIES.includes(text as Quality)
}

/** "Bird's Eye" as "birds-eye". */
function slug(camera: Camera): string {
  return camera.toLowerCase().replace("'", '').replace(' ', '-')
}

function rounded(value: number): string {
  return String(Number(value.toFixed(3)))
}

/** A finite number; undefined for another text. */
function number(text: string): number | undefined {
  const value = Number(text)
  return text.trim() !== '' && Number.isFinite(value) ? value : undefined
}

function scaled(text: string, factor: number): number | undefined {
  const value = number(text)
  return value === undefined ? undefined : value * factor
}

/** Azimuth and elevation [degree] and distance [m]. */
function orbitText(orbit: Orbit | null): string {
  if (!orbit) return ''
  return [orbit.azimuth / DEGREE, orbit.elevation / DEGREE, orbit.distance].map(rounded).join()
}

function orbitOf(text: string): Orbit | undefined {
  const [azimuth, elevation, distance] = text.split(',').map(number)
  if (azimuth === undefined || elevation === undefined || !distance) return undefined
  const within = { elevation: clamp(elevation * DEGREE, ORBIT_ELEVATION), distance: clamp(distance, ORBIT_DISTANCE) }
  return { azimuth: azimuth * DEGREE, ...within }
}

/** Place [m], azimuth and elevation [degree]. */
function flyText(fly: Fly | null): string {
  return fly ? [fly.x, fly.y, fly.z, fly.azimuth / DEGREE, fly.elevation / DEGREE].map(rounded).join() : ''
}

function flyOf(text: string): Fly | undefined {
  const numbers = text.split(',').map(number)
  if (numbers.length !== 5 || numbers.includes(undefined)) return undefined
  const [x, y, z, azimuth, elevation] = numbers as number[]
  return within({ x, y, z, azimuth: azimuth * DEGREE, elevation: elevation * DEGREE })
}
