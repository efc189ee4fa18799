import { beforeEach, expect, test, vi } from 'vitest'

import type { ServerMessage } from '../src/messages'
import type { PageMessage, WorkerMessage } from '../src/worker/port'
import { serve } from '../src/worker/serve'
import { FakeSocket, frameOf, scanOf, sceneOf, statusOf, welcome } from './support'

beforeEach(() => {
  vi.useFakeTimers()
  return () => vi.useRealTimers()
})

/** A worker whose page is busy: it answers only when the test says so. */
function workerOfBusyPage() {
  FakeSocket.install()
  const posted: WorkerMessage[] = []
  let tell = (_: PageMessage): void => {}
  serve({
    postMessage: (message) => posted.push(message),
    addEventListener: (_, listener) => (tell = (data) => listener({ data } as MessageEvent)),
  })
  tell({ type: 'Open', url: 'ws://simulator.test/ws' })
  const socket = FakeSocket.latest
  socket.open()
  const receive = (...messages: ServerMessage[]) => messages.forEach((message) => void socket.receive(message))
  receive(welcome(), sceneOf(['V1']), frameOf())
  tell({ type: 'Select', vehicle: 'V1' })
  /** What the page gets when it answers again. */
  const taken = () => {
    posted.length = 0
    tell({ type: 'Taken' })
    return posted.filter(({ type }) => type !== 'End')
  }
  return { tell, socket, receive, taken }
}

const offRoad = (time: number) => ({ type: 'OffRoad' as const, time, vehicle: 'V1', position: new Float64Array(3) })

test('a busy page gets the latest state, and the events of all Frames', () => {
  const { receive, taken } = workerOfBusyPage()
  taken()
  for (let tick = 1; tick <= 100; tick++) {
    receive({ type: 'Scan', vehicle: 'V1', scan: scanOf([tick]) })
    receive(frameOf(['V1'], { tick, events: tick % 40 === 0 ? [offRoad(tick)] : [] }))
    receive(statusOf({ clients: tick }))
  }
  const messages = taken()
  expect(messages.map(({ type }) => type)).toEqual(['Scan', 'Frame', 'Status'])
  expect(messages[1]).toMatchObject({ tick: 100, events: [{ time: 40 }, { time: 80 }] })
  expect(taken()).toEqual([])
})

test('a busy page gets the places between all Frames, before the Frame that ends them', () => {
  const { receive, taken } = workerOfBusyPage()
  taken()
  for (let tick = 1; tick <= 3; tick++) {
    const positions = { V1: new Float64Array([tick, 0, 0]) }
    receive({ type: 'Ways', times: new Float64Array([tick]), positions }, frameOf(['V1'], { tick }))
  }
  const [ways, frame, ...others] = taken()
  expect(ways).toMatchObject({ type: 'Ways', times: new Float64Array([1, 2, 3]) })
  expect(ways).toMatchObject({ positions: { V1: new Float64Array([1, 0, 0, 2, 0, 0, 3, 0, 0]) } })
  expect([frame, ...others]).toMatchObject([{ type: 'Frame', tick: 3 }])
})

test('a busy page gets every response and error, and no Frame after a later Scene', () => {
  const { receive, taken } = workerOfBusyPage()
  taken()
  receive(frameOf(['V1'], { tick: 1, events: [offRoad(1)] }))
  const answer = { frame: frameOf(), text: '', curves: {}, files: {}, picture: new Uint8Array() }
  receive({ type: 'Response', id: 1, ...answer }, { type: 'Response', id: 2, ...answer })
  receive({ type: 'Error', code: 'request', text: 'no', id: 3 }, sceneOf(['V1']), frameOf(['V1'], { tick: 2 }))
  const messages = taken()
  expect(messages.map(({ type }) => type)).toEqual(['Frame', 'Response', 'Response', 'Error', 'Scene', 'Frame'])
  expect(messages.at(-1)).toMatchObject({ tick: 2, events: [] })
})

test('a held key drives while the page gives signs of life, and the vehicle stops within a second of the last', () => {
  const { tell, socket } = workerOfBusyPage()
  const rest = { throttle: 0, steering: 0 }
  const hold = () => tell({ type: 'Inputs', keys: { throttle: 1, steering: 0 }, direct: rest })
  for (let i = 0; i < 10; i++) {
    hold()
    vi.advanceTimersByTime(200)
  }
  expect(socket.of('Drive').length).toBeGreaterThan(100)
  expect(socket.of('Drive').at(-1)?.command).toEqual({ throttle: 1, steering: 0 })
  vi.advanceTimersByTime(800)
  expect(socket.of('Drive').at(-1)?.command).toEqual(rest)
  const count = socket.sent.length
  vi.advanceTimersByTime(5000)
  expect(socket.sent.length).toBe(count)
})

test('a vehicle stops, and is not driven, while the simulator is silent', () => {
  const { tell, socket, receive } = workerOfBusyPage()
  const rest = { throttle: 0, steering: 0 }
  const hold = (seconds: number) => {
    for (let i = 0; i < 5 * seconds; i++) {
      tell({ type: 'Inputs', keys: { throttle: 1, steering: 0 }, direct: rest })
      vi.advanceTimersByTime(200)
    }
  }
  hold(2.8)
  expect(socket.of('Drive').at(-1)?.command.throttle).toBe(1)
  hold(1)
  expect(socket.of('Drive').at(-1)?.command).toEqual(rest)
  const count = socket.sent.length
  hold(3)
  expect(socket.sent.length).toBe(count)
  receive(frameOf())
  hold(1)
  expect(socket.of('Drive').at(-1)?.command.throttle).toBe(1)
})
