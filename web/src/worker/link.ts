// The WebSocket connection to the simulator: MessagePack messages, the subscription, reconnection.
import { Decoder, Encoder, ExtensionCodec } from '@msgpack/msgpack'
import type { ClientMessage, ServerMessage, Subscribe } from '../messages'
import { ARRAYS, PROTOCOL, SUBPROTOCOL } from '../messages'
import type { WorkerMessage } from './port'

/** Delay before a reconnection [ms]: doubled after each failure, from the first to the second value. */
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

export class Link {
  private socket: WebSocket | null = null
  private subscription: Subscribe = { type: 'Subscribe', drawings: true }
  private retryDelay = RETRY

  /** `onMessage` gets each message of the simulator, and `Lost` when there is no connection any more. */
  constructor(private readonly onMessage: (message: WorkerMessage) => void) {}

  /** Connects, and reconnects whenever the connection is lost. */
  open(url: string): void {
    const socket = new WebSocket(url, SUBPROTOCOL)
    socket.binaryType = 'arraybuffer'
    socket.onopen = () => {
      this.send({ type: 'Hello', protocol: PROTOCOL, name: 'page' })
      this.send(this.subscription)
    }
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.receive(decoder.decode(event.data) as ServerMessage)
    socket.onclose = (event) => {
      this.onMessage({ type: 'Lost', reason: event.reason })
      setTimeout(() => this.open(url), this.retryDelay)
      this.retryDelay = Math.min(2 * this.retryDelay, RETRY_MAX)
    }
    this.socket = socket
  }

  /** Sends a message; does nothing without a connection. */
  send(message: ClientMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(encoder.encode(message))
  }

  /** Sends a subscription, now and after each reconnection. */
  subscribe(subscription: Subscribe): void {
    this.subscription = subscription
    this.send(subscription)
  }

  private receive(message: ServerMessage): void {
    if (message.type === 'Welcome' || message.type === 'Starting') this.retryDelay = RETRY
    this.onMessage(message)
  }
}
