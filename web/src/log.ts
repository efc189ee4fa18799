// The log of the page: all notices, events and errors with their times.
import { sentence } from './actions'
import { lapTime } from './lap_time'
import type { Event, Scene } from './messages'
import { RaceStatus } from './messages'
import { Observable } from './observable'
import type { Store } from './store'

export type Level = 'info' | 'good' | 'warning' | 'error'

export interface Entry {
  /** Wall time. */
  at: Date
  /** Simulated time [s]; null before the first Frame. */
  time: number | null
  level: Level
  text: string
  /** One of many of its kind, which the log shows on demand. */
  isDetail: boolean
}

/** Number of entries, of details and of others; older ones are dropped. */
const KEPT = 500

const BRIDGE = { closed: 'disconnected', connecting: 'connecting', connected: 'connected' }

/** Collects the entries from now on. */
export function logOf(store: Store): Observable<readonly Entry[]> {
  const entries = new Observable<readonly Entry[]>(kept())

  function add(level: Level, text: string, time = store.frame.value?.time ?? null, isDetail = false): void {
    const entry = { at: new Date(), time, level, text, isDetail }
    const like = entries.value.filter((one) => one.isDetail === isDetail)
    const oldest = like.length < KEPT ? null : like[0]
    entries.value = [...entries.value.filter((one) => one !== oldest), entry]
  }

  /** Adds a text when it changes to another one that is not empty. */
  function whenChanged(level: Level, prefix: string): (text: string) => void {
    let before = ''
    return (text) => {
      if (text && text !== before) add(level, prefix + sentence(text))
      before = text
    }
  }

  store.notice.watch((text) => text && add('info', sentence(text)))
  store.error.watch((text) => text && add('error', sentence(text)))
  store.warning.watch((text) => text && add('warning', sentence(text)))
  store.told.watch((events) => {
    for (const event of events) {
      const [text, level] = describe(event, store.scene.value)
      add(level, text, event.time, isDetail(event))
    }
  })
  const bridgeError = whenChanged('error', 'Bridge: ')
  const camerasError = whenChanged('error', 'Cameras: ')
  const camerasNote = whenChanged('info', 'Cameras: ')
  const bridgeState = whenChanged('info', 'Bridge: ')
  const physicsError = whenChanged('error', '')
  let wasBridgeUsed = false
  store.status.watch((status) => {
    bridgeError(status?.bridge.error ?? '')
    camerasError(status?.cameras_error ?? '')
    camerasNote(status?.cameras_note ?? '')
    physicsError(status?.error ?? '')
    const isUsed = status && (status.bridge.state !== 'closed' || wasBridgeUsed)
    wasBridgeUsed ||= Boolean(isUsed)
    bridgeState(isUsed ? `${BRIDGE[status.bridge.state]}, ${status.bridge.address}` : '')
  })
  let wasLost = false
  store.link.watch((link) => {
    if (link === 'lost' && !wasLost) add('error', `The connection is lost. ${sentence(store.connectionError.value)}`)
    if (link === 'open') add('good', wasLost ? 'Connected again.' : 'Connected.')
    if (link === 'open' || link === 'lost') wasLost = link === 'lost'
  })
  window.addEventListener('pagehide', () => keep(entries.value))
  return entries
}

/** Place of the log in the storage of the tab: a reload keeps the entries, another tab has its own. */
const PLACE = 'autodrive.log'
/** Number of entries that a reload keeps. */
const KEPT_BY_RELOAD = 200

function keep(entries: readonly Entry[]): void {
  try {
    sessionStorage.setItem(PLACE, JSON.stringify(entries.slice(-KEPT_BY_RELOAD)))
  } catch {
    // Storage is disabled or full: a reload empties the log.
  }
}

function kept(): Entry[] {
  try {
    const entries: Entry[] = JSON.parse(sessionStorage.getItem(PLACE) ?? '[]')
    return entries.map((entry) => ({ ...entry, at: new Date(entry.at) }))
  } catch {
    return []
  }
}

const RACE_STATUS = {
  [RaceStatus.WAITING]: 'waits for the start',
  [RaceStatus.RACING]: 'races',
  [RaceStatus.FINISHED]: 'has finished',
  [RaceStatus.DISQUALIFIED]: 'is disqualified',
  [RaceStatus.RETIRED]: 'has retired',
}

/** Whether an event is one of many of its kind, or tells more of an earlier one. */
export function isDetail(event: Event): boolean {
  return event.type === 'CheckpointPassed' || event.type === 'CollisionEnded'
}

/** What a vehicle touches, in words: the kind of a part of the map, the name of a vehicle or of a box. */
export function touched(name: string, scene: Scene | null): string {
  if (scene && name in scene.vehicles) return name
  const words = name.replaceAll('_', ' ')
  if (scene && name in scene.objects) return words
  const map = scene?.map_scene
  const part = map?.parts[name]
  const title = part?.type === 'MapModule' ? map?.modules[part.module]?.title : undefined
  if (title) return `${/^[aeiou]/i.test(title) ? 'an' : 'a'} ${title.charAt(0).toLowerCase()}${title.slice(1)}`
  return /\d$/.test(words) ? words : `the ${words}`
}

/** The text of an event in a scene, and its level. */
export function describe(event: Event, scene: Scene | null): [string, Level] {
  switch (event.type) {
    case 'Collision':
      return [`${event.vehicle} hit ${touched(event.other, scene)}`, 'warning']
    case 'CollisionEnded':
      return [
        `${event.vehicle} touched ${touched(event.other, scene)} for ${event.duration.toFixed(2)} s: ${event.impulse.toFixed(2)} N s`,
        'info',
      ]
    case 'OffRoad':
      return [`${event.vehicle} left the road`, 'warning']
    case 'BackOnRoad':
      return [`${event.vehicle} is back on the road`, 'good']
    case 'RedLight':
      return [`${event.vehicle} crossed the stop line of ${event.light} at red`, 'warning']
    case 'StopSign':
      return [`${event.vehicle} did not stop at ${event.sign}`, 'warning']
    case 'CheckpointPassed':
      return [`${event.vehicle} passed checkpoint ${event.checkpoint} of lap ${event.lap}`, 'info']
    case 'LapCompleted':
      return [
        `${event.vehicle} completed lap ${event.lap} in ${lapTime(event.lap_time)}${event.is_counted ? '' : ', a warm-up lap'}`,
        'good',
      ]
    case 'RacePenalty':
      return [`${event.vehicle} gets ${event.duration} s: ${event.reason}`, 'warning']
    case 'SetBack':
      return [`${event.vehicle} is set back to checkpoint ${event.checkpoint}`, 'info']
    case 'WrongWay':
      return [`${event.vehicle} drives the wrong way`, 'warning']
    case 'RaceStatusChanged':
      return [`${event.vehicle} ${RACE_STATUS[event.status]}${event.reason && `: ${event.reason}`}`, 'info']
  }
}
