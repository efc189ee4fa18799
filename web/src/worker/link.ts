// The WebSocket connection to the simulator: MessagePack messages, the subscription, reconnection.
import { Decoder, Encoder, ExtensionCodec } from '@msgpack/msgpack'
import type { ClientMessage, ServerMessage, Subscribe } from '../messages'
import { ARRAYS, PROTOCOL, SUBPROTOCOL } from '../messages'
import type { WorkerMessage } from './port'

/** Delay before a reconnection [ms]: doubled after each failure, from the first to the second value. */
const RETRY = 200
const RETRY_MAX = 2000
/** Period of the watch for a connection without data [ms]. */
const WATCH = 250
/** Times without a message after which the page is told [ms]; `connection.ts` says what it does. */
const SILENCES = [3000, 5000]
/** Time without a message after which a new connection is made [ms]. */
const MAX_SILENCE = 10_000

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

export class Link {
  private socket: WebSocket | null = null
  private subscription: Subscribe = { type: 'Subscribe', drawings: true, ways: true }
  private retryDelay = RETRY
  /** Time of the latest message [ms], and how many of `SILENCES` have passed since. */
  private lastMessage = 0
  private silences = 0
  /** `clock` of the latest Status of this connection. */
  private heard: number | null = null
  private wasOpen = false

  /** `onMessage` gets each message of the simulator, `Silence`, `Heard`, and `Lost` when there is no connection. */
  constructor(private readonly onMessage: (message: WorkerMessage) => void) {}

  /** Connects, and reconnects whenever the connection is lost. */
  open(url: string): void {
    this.connect(url)
    setInterval(() => this.watch(url), WATCH)
  }

  private connect(url: string): void {
    const socket = new WebSocket(url, SUBPROTOCOL)
    this.lastMessage = performance.now()
    this.silences = 0
    this.heard = null
    this.wasOpen = false
    socket.binaryType = 'arraybuffer'
    socket.onopen = () => {
      this.wasOpen = true
      this.send({ type: 'Hello', protocol: PROTOCOL, name: 'page' })
      this.send(this.subscription)
    }
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.receive(decoder.decode(event.data) as ServerMessage)
    socket.onclose = (event) => this.reconnect(url, event.reason)
    this.socket = socket
  }

  private reconnect(url: string, reason: string): void {
    this.socket = null
    this.onMessage({ type: 'Lost', reason, wasOpen: this.wasOpen })
    setTimeout(() => this.connect(url), this.retryDelay)
    this.retryDelay = Math.min(2 * this.retryDelay, RETRY_MAX)
  }

  /** A connection can stay open and pass no data: a proxy that hangs, a simulator that was stopped, a cable. */
  private watch(url: string): void {
    const socket = this.socket
    if (!socket || socket.readyState > WebSocket.OPEN) return
    const silence = performance.now() - this.lastMessage
    if (silence >= MAX_SILENCE) {
      socket.onopen = socket.onmessage = socket.onclose = null
      socket.close()
      this.reconnect(url, '')
    } else if (silence >= SILENCES[this.silences]) {
      this.onMessage({ type: 'Silence', seconds: SILENCES[this.silences] / 1000 })
      this.silences += 1
    }
  }

  /** Sends a message; does nothing without a connection. */
  send(message: ClientMessage): void {
    if (message.type === 'Request') message.heard = this.heard
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(encoder.encode(message))
  }

  /** Sends a subscription, now and after each reconnection. */
  subscribe(subscription: Subscribe): void {
    this.subscription = subscription
    this.send(subscription)
  }

  private receive(message: ServerMessage): void {
    this.lastMessage = performance.now()
    if (this.silences > 0) this.onMessage({ type: 'Heard' })
    this.silences = 0
    if (message.type === 'Status') this.heard = message.clock
    if (message.type === 'Welcome' || message.type === 'Starting') this.retryDelay = RETRY
    this.onMessage(message)
  }
}
