// The WebSocket to the simulator: messages in MessagePack, requests with answers, and a new try when it is lost.
import { Decoder, Encoder, ExtensionCodec } from '@msgpack/msgpack'

import { ARRAYS, PROTOCOL, SUBPROTOCOL } from './messages'
import type { Ask, ClientMessage, Frame, ServerMessage, Subscribe } from './messages'
import type { Store } from './store'

/** Wait before a new try [ms]: doubled from the first to the second until one succeeds. */
const RETRY = 200
const RETRY_MAX = 2000

const codec = new ExtensionCodec()
for (const [code, Values] of Object.entries(ARRAYS)) {
  codec.register({
    type: Number(code),
    encode: () => null,
    decode: (data) => new Values(data.slice().buffer),
  })
}
const encoder = new Encoder({ ignoreUndefined: true })
const decoder = new Decoder({ extensionCodec: codec, useBigInt64: false })

interface Waiting {
  done: (frame: Frame) => void
  failed: (fault: Error) => void
}

export class Connection {
  private socket: WebSocket | null = null
  private readonly waiting = new Map<number, Waiting>()
  private nextId = 1
  private retry = RETRY
  private subscription: Subscribe = { type: 'Subscribe' }
  /** Why the simulator does not want to talk to this page. */
  private fault = ''

  constructor(private readonly store: Store) {}

  /** Connects, and again whenever the connection is lost. */
  open(): void {
    const url = new URL('ws', document.baseURI)
    url.protocol = url.protocol.replace('http', 'ws')
    url.search = location.search
    if (this.store.link.value !== 'lost') this.store.link.value = 'connecting'
    const socket = new WebSocket(url, SUBPROTOCOL)
    socket.binaryType = 'arraybuffer'
    socket.onopen = () => this.greet()
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.take(decoder.decode(event.data) as ServerMessage)
    socket.onclose = (event) => this.lose(event.reason)
    this.socket = socket
  }

  /** Says something, if anybody hears it; whether somebody does. */
  send(message: ClientMessage): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false
    this.socket.send(encoder.encode(message))
    return true
  }

  /** Changes what this page is sent; kept over a new connection. */
  subscribe(subscription: Omit<Subscribe, 'type'>): void {
    this.subscription = { ...this.subscription, ...subscription }
    this.send(this.subscription)
  }

  /** The Frame after the request was carried out; rejects with the server's words if it was not. */
  request(ask: Ask): Promise<Frame> {
    const id = this.nextId++
    return new Promise((done, failed) => {
      this.waiting.set(id, { done, failed })
      if (!this.send({ type: 'Please', id, request: ask })) this.answer(id)?.failed(new Error('no connection'))
    })
  }

  private greet(): void {
    this.send({ type: 'Hello', protocol: PROTOCOL, name: 'page' })
    this.send(this.subscription)
  }

  private lose(reason: string): void {
    this.store.lost.value = reason || this.fault || `The simulator at ${location.host} does not answer.`
    this.store.link.value = 'lost'
    for (const id of [...this.waiting.keys()]) this.answer(id)?.failed(new Error('the connection was lost'))
    setTimeout(() => this.open(), this.retry)
    this.retry = Math.min(2 * this.retry, RETRY_MAX)
  }

  private answer(id: number): Waiting | undefined {
    const waiting = this.waiting.get(id)
    this.waiting.delete(id)
    return waiting
  }

  private take(message: ServerMessage): void {
    const store = this.store
    switch (message.type) {
      case 'Welcome':
        this.retry = RETRY
        this.fault = ''
        store.welcome.value = message
        store.link.value = 'open'
        break
      case 'Scene':
        store.scans.clear()
        store.pictures.clear()
        if (!(store.vehicle.value in message.vehicles)) store.vehicle.value = Object.keys(message.vehicles)[0] ?? ''
        store.scene.value = message
        break
      case 'Status':
        store.status.value = message
        break
      case 'Scan':
        store.scans.set(message.vehicle, message.scan)
        break
      case 'Picture':
        store.pictures.set(`${message.vehicle}/${message.camera}`, message)
        break
      case 'Rendered':
        store.rendered.value = message
        break
      case 'Frame':
        this.show(message)
        break
      case 'Done':
        this.show(message.frame)
        this.answer(message.id)?.done(message.frame)
        break
      case 'Fault': {
        const waiting = message.id === null ? undefined : this.answer(message.id)
        if (waiting) waiting.failed(new Error(message.text))
        else if (message.code === 'version') this.fault = message.text
        else store.notice.value = message.text
      }
    }
  }

  private show(frame: Frame): void {
    if (frame.events.length > 0) this.store.events.value = frame.events
    this.store.frame.value = frame
  }
}
