// The connection of the page to the simulator, which its worker keeps: requests with responses, messages to the store.
import type { Frame, LidarScan, Response, Scene, ServerOperation, Status, Subscribe } from './messages'
import type { Store } from './store'
import type { PageMessage, Port, WorkerMessage } from './worker/port'

interface Pending {
  resolve: (response: Response) => void
  reject: (error: Error) => void
}

/** Requests without an answer are given up after this silence of the simulator [s]. */
const GIVE_UP = 5

/** The simulator answers so to requests of its WebSocket by HTTP. */
const UPGRADE_REQUIRED = 426
const NO_WEBSOCKETS =
  'The simulator answers, but the proxy in between does not pass WebSockets; docs/proxy.md describes how it does.'

export class Connection {
  private readonly pending = new Map<number, Pending>()
  private nextId = 1
  /** Scans of vehicles from before the map was changed: the server sends them again while time does not run. */
  private readonly outdated = new Map<string, LidarScan>()
  private subscription: Subscribe = { type: 'Subscribe', drawings: true, ways: true }
  /** Why the simulator refused this page. */
  private refusal = ''

  constructor(
    private readonly store: Store,
    private readonly worker: Port<PageMessage>,
  ) {
    worker.addEventListener('message', (event: MessageEvent<WorkerMessage>) => this.receive(event.data))
  }

  /** Connects, and reconnects whenever the connection is lost. */
  open(): void {
    const url = address()
    url.protocol = url.protocol.replace('http', 'ws')
    this.post({ type: 'Open', url: url.href })
  }

  /** Tells the worker something. */
  post(message: PageMessage): void {
    this.worker.postMessage(message)
  }

  /** Changes the subscription; it is sent again after a reconnection. */
  subscribe(subscription: Omit<Subscribe, 'type'>): void {
    this.subscription = { ...this.subscription, ...subscription }
    this.post(this.subscription)
  }

  /** Sends a request; resolves to the Response, or rejects with the error message of the server. */
  request(operation: ServerOperation): Promise<Response> {
    if (this.store.link.value !== 'open') return Promise.reject(new Error('not connected to the simulator'))
    const id = this.nextId++
    return new Promise((resolve, reject) => {
      this.pending.set(id, { resolve, reject })
      this.post({ type: 'Request', id, operation })
    })
  }

  private onLost(reason: string, wasOpen: boolean): void {
    this.store.connectionError.value = reason || this.refusal || `The simulator at ${location.host} does not answer.`
    this.store.link.value = 'lost'
    this.rejectPending('the connection to the simulator was lost')
    if (!wasOpen) void this.diagnose()
  }

  /** Asks by HTTP why no connection can be made: browsers do not tell pages the answer to a WebSocket. */
  private async diagnose(): Promise<void> {
    const answer = await fetch(address(), { method: 'POST' }).catch(() => null) // a GET would not have the origin
    if (!answer) return
    const isOurs = answer.headers.get('x-autodrive') !== null
    const said = isOurs ? await answer.text() : `a proxy at ${location.host} answers with the status ${answer.status}`
    this.refusal = answer.status === UPGRADE_REQUIRED ? NO_WEBSOCKETS : said
    if (this.store.link.value === 'lost') this.store.connectionError.value = this.refusal
  }

  /** The simulator refuses later the requests that are given up here: see `heard` of Request. */
  private onSilence(seconds: number): void {
    this.store.connectionError.value = `No data has come from the simulator at ${location.host} for ${seconds} s.`
    this.store.link.value = 'lost'
    if (seconds >= GIVE_UP) this.rejectPending(`no answer for ${seconds} s; the request is not carried out`)
  }

  private rejectPending(reason: string): void {
    for (const id of [...this.pending.keys()]) this.takePending(id)?.reject(new Error(reason))
  }

  private takePending(id: number): Pending | undefined {
    const pending = this.pending.get(id)
    this.pending.delete(id)
    return pending
  }

  private receive(message: WorkerMessage): void {
    const store = this.store
    switch (message.type) {
      case 'Starting':
        store.starting.value = message
        store.link.value = 'starting'
        if (message.scene) this.setScene(message.scene)
        if (message.frame) this.setFrame(message.frame)
        break
      case 'Welcome':
        this.refusal = ''
        store.welcome.value = message
        store.link.value = 'open'
        break
      case 'Scene':
        this.setScene(message)
        break
      case 'Status':
        if (isOfOthers(message, store)) store.notice.value = `${message.change}.`
        store.status.value = message
        break
      case 'Scan':
        if (isSame(message.scan, this.outdated.get(message.vehicle))) break
        this.outdated.delete(message.vehicle)
        store.scans.set(message.vehicle, message.scan)
        break
      case 'Ways':
        store.ways.value = message
        break
      case 'Drawn':
        if (message.drawing) store.drawings.set(message.name, message)
        else store.drawings.delete(message.name)
        store.drawingChanges.value += 1
        break
      case 'Shapes':
        store.shapes.value = message
        break
      case 'Contacts':
        store.contacts.value = message.vehicles
        break
      case 'Picture':
        store.cameraImages.set(`${message.vehicle}/${message.camera}`, message)
        break
      case 'Rendered':
        store.rendered.value = message
        break
      case 'SensorView':
        store.sensorView.value = message
        break
      case 'Frame':
        this.setFrame(message)
        break
      case 'Response':
        this.setFrame(message.frame)
        this.takePending(message.id)?.resolve(message)
        break
      case 'Error': {
        const pending = message.id === null ? undefined : this.takePending(message.id)
        if (pending) pending.reject(new Error(message.text))
        else if (message.code === 'version') store.reloadReason.value = this.refusal = message.text
        else if (message.id === null) store.warning.value = message.text
        break
      }
      case 'Lost':
        this.onLost(message.reason, message.wasOpen)
        break
      case 'Silence':
        this.onSilence(message.seconds)
        break
      case 'Heard':
        if (store.welcome.value) store.link.value = 'open'
        break
      case 'Blocked':
        if (message.vehicle === store.watched.value) break // the user takes the wheel just now
        store.notice.value = store.scene.value?.timeline
          ? 'This is a replay. The recorded commands drive.'
          : `${message.vehicle} is in Autonomous mode. Press Driving Mode in the menu to drive.`
        break
      case 'End':
        this.post({ type: 'Taken' })
    }
  }

  private setScene(scene: Scene): void {
    const store = this.store
    if (mapOf(scene) !== mapOf(store.scene.value))
      for (const [vehicle, scan] of store.scans) this.outdated.set(vehicle, scan)
    store.scans.clear()
    store.cameraImages.clear()
    store.drawings.clear()
    store.drawingChanges.value += 1
    store.shapes.value = null
    store.contacts.value = {}
    store.forceScale.value = 0
    if (!(store.vehicle.value in scene.vehicles)) store.vehicle.value = Object.keys(scene.vehicles)[0] ?? ''
    store.scene.value = scene
  }

  private setFrame(frame: Frame): void {
    if (frame.events.length > 0) this.store.events.value = frame.events
    this.store.frame.value = frame
  }
}

/** The address of the WebSocket, for HTTP. */
function address(): URL {
  const url = new URL('ws', document.baseURI)
  url.search = location.search
  return url
}

/** The parts of the map, or the race track, for a comparison. */
function mapOf(scene: Scene | null): string {
  return JSON.stringify([scene?.map_scene?.parts, scene?.track_scene?.line])
}

/** Whether another client has changed what all share since the Status before. */
function isOfOthers({ change, changes }: Status, store: Store): boolean {
  const before = store.status.value
  return before !== null && changes > before.changes && !change.startsWith(`${store.welcome.value?.name} has `)
}

function isSame(scan: LidarScan, other: LidarScan | undefined): boolean {
  return scan.time === other?.time && scan.ranges.every((range, i) => Object.is(range, other.ranges[i]))
}
