// Fakes for the unit tests: a socket, Frames, and the messages of a server.
import { Decoder, Encoder, ExtensionCodec } from '@msgpack/msgpack'
import { vi } from 'vitest'

import { Connection } from '../src/connection'
import type {
  ClientMessage,
  Frame,
  LidarScan,
  Pose,
  Scene,
  ServerMessage,
  Status,
  VehicleFrame,
  Welcome,
} from '../src/messages'
import { ARRAYS, Headlights, Indicators, TailLights } from '../src/messages'
import { Store } from '../src/store'
import type { PageMessage, Port, WorkerMessage } from '../src/worker/port'
import { serve } from '../src/worker/serve'

const codec = new ExtensionCodec()
for (const [code, Values] of Object.entries(ARRAYS)) {
  codec.register({
    type: Number(code),
    encode: (value) =>
      value instanceof Values ? new Uint8Array(value.buffer, value.byteOffset, value.byteLength) : null,
    decode: (data) => new Values(data.slice().buffer),
  })
}
const encoder = new Encoder({ extensionCodec: codec })
const decoder = new Decoder({ extensionCodec: codec })

export function decodeFrame(base64: string): Frame {
  return decoder.decode(new Uint8Array(Buffer.from(base64, 'base64'))) as Frame
}

/** Replaces WebSocket; the test plays the server. */
export class FakeSocket {
  static readonly OPEN = 1
  static all: FakeSocket[] = []
  readyState = 0
  binaryType = ''
  onopen: (() => void) | null = null
  onmessage: ((_: { data: ArrayBuffer }) => void) | null = null
  onclose: ((_: { reason: string }) => void) | null = null
  readonly sent: ClientMessage[] = []

  constructor(
    readonly url: string,
    readonly protocol: string,
  ) {
    FakeSocket.all.push(this)
  }

  static get latest(): FakeSocket {
    return FakeSocket.all[FakeSocket.all.length - 1]
  }

  /** Installs this class as WebSocket, until the end of the test. */
  static install(): void {
    for (const socket of FakeSocket.all) socket.readyState = 3 // pages of earlier tests stay as they are
    FakeSocket.all = []
    vi.stubGlobal('WebSocket', FakeSocket)
  }

  send(data: Uint8Array): void {
    this.sent.push(decoder.decode(data) as ClientMessage)
  }

  open(): void {
    this.readyState = FakeSocket.OPEN
    this.onopen?.()
  }

  close(reason = ''): void {
    this.readyState = 3
    this.onclose?.({ reason })
  }

  receive(message: ServerMessage): void {
    this.onmessage?.({ data: encoder.encode(message).slice().buffer })
  }

  /** The messages of that type that the page sent. */
  of<Type extends ClientMessage['type']>(type: Type): Extract<ClientMessage, { type: Type }>[] {
    return this.sent.filter((message) => message.type === type) as Extract<ClientMessage, { type: Type }>[]
  }

  /** What the latest request asks for. */
  get request(): { type: string; [field: string]: unknown } {
    return this.of('Request').at(-1)?.operation as unknown as { type: string }
  }

  /** Answers the latest request with a Frame, or with an error. */
  respond(frame: Frame | string, text = ''): void {
    const id = this.of('Request').at(-1)?.id ?? 0
    if (typeof frame === 'string') this.receive({ type: 'Error', code: 'request', text: frame, id })
    else this.receive({ type: 'Response', id, frame, text, curves: {}, files: {}, picture: new Uint8Array() })
  }
}

/** Two ports that are connected in one thread: a message is copied as between threads, and delivered at once. */
function ports(): [Port<PageMessage>, Port<WorkerMessage>] {
  const ends = [new EventTarget(), new EventTarget()]
  const port = (from: EventTarget, to: EventTarget): Port<unknown> => ({
    postMessage: (message) => to.dispatchEvent(Object.assign(new Event('message'), { data: structuredClone(message) })),
    addEventListener: (type, listener) => from.addEventListener(type, listener as unknown as EventListener),
  })
  return [port(ends[0], ends[1]), port(ends[1], ends[0])]
}

/** A page whose worker runs in the same thread. */
export function newPage() {
  FakeSocket.install()
  const [page, worker] = ports()
  serve(worker)
  const store = new Store()
  const connection = new Connection(store, page)
  connection.open()
  return { store, connection }
}

/** A page that is connected to a fake server. */
export function connectedPage(vehicles: readonly string[] = ['V1']) {
  const { store, connection } = newPage()
  const socket = FakeSocket.latest
  socket.open()
  socket.receive(welcome())
  socket.receive(sceneOf(vehicles))
  socket.receive(statusOf())
  socket.receive(frameOf(vehicles))
  return { store, connection, socket }
}

export function welcome(values: Partial<Welcome> = {}): Welcome {
  const scenarios = { plane: 'Empty plane', two_cars: 'Two cars' }
  return {
    ...{ type: 'Welcome', protocol: 2, version: '0', name: 'page-1', scenarios, folder: '', run: null, title: '' },
    has_start_screen: false,
    ...values,
  }
}

export function sceneOf(vehicles: readonly string[], scenario = 'plane'): Scene {
  const vehicle = {
    ...{ type: 'nigel', model: 'scene/nigel.glb', half_length: 0.14, steering_limit: 0.5, lamps: {} },
    ...{ cameras: ['front', 'rear'], lidar: pose(), wheelbase: 0.14, wheel_radius: 0.03, speed_limit: 0.26 },
    ...{
      sensor_noise: {},
      is_lidar_level: false,
      missing_gravity: 0,
      size: [0.28, 0.2, 0.2] as [number, number, number],
      is_traffic: false,
    },
    sensors: {
      lidar: {
        is_on: true,
        rate: 7,
        noise: 'file',
        noises: ['ideal', 'file', 'realistic', 'strong'],
        is_camera: false,
      },
    },
  }
  return {
    ...{
      type: 'Scene',
      scenario,
      title: scenario,
      map: 'plane',
      tick: 0.016,
      model: 'scene/map.glb',
      objects: {},
      ground: [],
    },
    plan: { image: 'scene/plan.svg', bounds: [-2, -1, 2, 1] },
    vehicles: Object.fromEntries(vehicles.map((name) => [name, vehicle])),
    ...{
      light_table: {},
      label_colours: {},
      object_sizes: {},
      warm_up_laps: 0,
      timeline: null,
      map_scene: null,
      track_scene: null,
    },
    scene_cameras: { "Bird's Eye": { height: 3, lowest: 1, highest: 10, step: 0.1 } },
  }
}

/** No film is made. */
export const FILM = { state: 'off', name: '', share: 0, error: '' } as const

export function statusOf(values: Partial<Status> = {}): Status {
  const rates = { telemetry_rate: 0, command_rate: 0, round_trip: null, devkit: '', note: '' }
  return {
    ...{ type: 'Status', is_paused: false, speed: 1, real_time_factor: 1, late_ticks: 0, clients: 1, drivers: {} },
    bridge: { address: '127.0.0.1:4567', state: 'closed', error: '', ...rates },
    recording: { state: 'off', file: '', duration: 0, size: 0, dropped: 0, error: '', download: '', film: FILM },
    ...{
      cameras_error: '',
      note: '',
      undo: '',
      redo: '',
      error: '',
      position: null,
      change: '',
      changes: 0,
      clock: 0,
      refused: {},
      cameras_note: '',
      episode: null,
      ...values,
    },
  }
}

export function frameOf(vehicles: readonly string[] = ['V1'], values: Partial<Frame> = {}): Frame {
  return {
    ...{ type: 'Frame', time: 0, tick: 0, objects: {}, events: [], scene_light: true, time_of_day: null },
    ...{ weather: null, weather_effects: null, traffic_lights: {} },
    vehicles: Object.fromEntries(vehicles.map((name) => [name, vehicleOf()])),
    ...values,
  }
}

export function vehicleOf(values: Partial<VehicleFrame> = {}): VehicleFrame {
  const wheels = () => new Float64Array(4)
  return {
    ...{ pose: pose(), velocity: new Float64Array(3), angular_velocity: new Float64Array(3), throttle: 0, steering: 0 },
    encoders: { time: 0, ticks: new BigInt64Array(2), angles: new Float64Array(2) },
    ips: { time: 0, position: new Float64Array(3) },
    imu: {
      ...{ time: 0, orientation: new Float64Array([1, 0, 0, 0]), euler: new Float64Array(3) },
      ...{ angular_velocity: new Float64Array(3), linear_acceleration: new Float64Array(3) },
    },
    lidar: null,
    lights: {
      ...{ headlights: Headlights.OFF, indicators: Indicators.OFF, tail_lights: TailLights.OFF },
      ...{ left_indicator: false, right_indicator: false, reverse_lights: false },
    },
    wheels: {
      ...{ steering_angle: wheels(), rotation_angle: wheels(), angular_velocity: wheels(), compression: wheels() },
      ...{ normal_load: wheels(), slip_ratio: wheels(), slip_angle: wheels() },
    },
    ...{
      is_autonomous: false,
      collision_count: 0,
      cameras: {},
      range: null,
      race: null,
      own: {},
      v2x: null,
      is_traffic: false,
      ...values,
    },
  }
}

export function scanOf(ranges: readonly number[], values: Partial<LidarScan> = {}): LidarScan {
  return {
    ...{ time: 0, ranges: new Float64Array(ranges), intensities: new Float64Array(ranges.length) },
    ...{ angle_min: 0, angle_increment: (2 * Math.PI) / ranges.length, range_min: 0.15, range_max: 12 },
    ...{ scan_rate: 7, scan_time: 1 / 7, time_increment: 1 / 7 / ranges.length, ...values },
  }
}

/** A pose at x, y [m] with a yaw [rad]. */
export function pose(x = 0, y = 0, yaw = 0): Pose {
  const orientation = new Float64Array([Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)])
  return { position: new Float64Array([x, y, 0]), orientation }
}
