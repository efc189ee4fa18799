// The messages that wait until the page takes them. A page that is busy gets the latest state, never a backlog.
import type { Ways } from '../messages'
import type { WorkerMessage } from './port'

/** Maximum number of events that a Frame collects for a page that is busy; the oldest are dropped. */
const MAX_EVENTS = 1000

/** Maximum number of places of Ways that are collected for a page that is busy; the oldest are dropped. */
const MAX_PLACES = 4096

/** Puts the places of earlier Ways before those of later ones. */
function join(before: Ways, later: Ways): void {
  const all = (a: Float64Array, b: Float64Array, n: number) => new Float64Array([...a, ...b].slice(-n))
  const known = Object.keys(later.positions).filter((name) => name in before.positions)
  later.positions = Object.fromEntries(
    known.map((name) => [name, all(before.positions[name], later.positions[name], 3 * MAX_PLACES)]),
  )
  later.times = all(before.times, later.times, MAX_PLACES)
}

export class Outbox {
  private waiting = new Map<string, WorkerMessage>()
  private isPageBusy = false
  private count = 0

  constructor(private readonly post: (message: WorkerMessage) => void) {}

  /** Posts a message now, or when the page has taken the previous ones; newer state replaces older state. */
  add(message: WorkerMessage): void {
    const key = this.keyOf(message)
    const before = this.waiting.get(key)
    this.waiting.delete(key) // a replaced message moves to the end: it follows what it belongs to
    if (before?.type === 'Frame' && message.type === 'Frame')
      message.events = [...before.events, ...message.events].slice(-MAX_EVENTS)
    if (before?.type === 'Ways' && message.type === 'Ways') join(before, message)
    this.waiting.set(key, message)
    this.flush()
  }

  /** The page has taken everything that was posted. */
  release(): void {
    this.isPageBusy = false
    this.flush()
  }

  private flush(): void {
    if (this.isPageBusy || this.waiting.size === 0) return
    this.isPageBusy = true
    const messages = [...this.waiting.values()]
    this.waiting.clear()
    for (const message of messages) this.post(message)
    this.post({ type: 'End' })
  }

  /** Messages with the same key replace each other, unless a message that is always delivered is between them. */
  private keyOf(message: WorkerMessage): string {
    switch (message.type) {
      case 'Frame':
      case 'Status':
      case 'Rendered':
      case 'Ways':
        return `${this.count} ${message.type}`
      case 'Starting':
        return message.scene ? String(++this.count) : `${this.count} Starting`
      case 'Drawn':
        return `${this.count} Drawn ${message.name}`
      case 'Scan':
        return `${this.count} Scan ${message.vehicle}`
      case 'Picture':
        return `${this.count} Picture ${message.vehicle}/${message.camera}`
      default:
        return String(++this.count)
    }
  }
}
