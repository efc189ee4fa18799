import { beforeEach, describe, expect, test, vi } from 'vitest'

import { type Drawing, PROTOCOL, type Scene, SUBPROTOCOL } from '../src/messages'
import { connectedPage, FakeSocket, frameOf, newPage, scanOf, sceneOf, statusOf, welcome } from './support'

beforeEach(() => {
  vi.useFakeTimers()
  return () => vi.useRealTimers()
})

test('the URL is relative to the page and carries its query', () => {
  newPage()
  expect(FakeSocket.latest.url).toBe('ws://simulator.test:8730/lab/ws?token=secret')
  expect(FakeSocket.latest.protocol).toBe(SUBPROTOCOL)
})

test('the first messages are Hello and the subscription', () => {
  const { connection } = newPage()
  connection.subscribe({ frame_rate: 5 })
  FakeSocket.latest.open()
  expect(FakeSocket.latest.sent).toEqual([
    { type: 'Hello', protocol: PROTOCOL, name: 'page' },
    { type: 'Subscribe', drawings: true, ways: true, frame_rate: 5 },
  ])
})

describe('messages of the server', () => {
  test('arrays are decoded and the Frame is stored', () => {
    const { store, socket } = connectedPage()
    const frame = frameOf(['V1'], { time: 2, tick: 125 })
    frame.vehicles.V1.pose.position.set([1.5, -2.25, 0.03])
    frame.vehicles.V1.encoders.ticks.set([12n, -7n])
    socket.receive(frame)
    expect(store.frame.value).toEqual(frame)
    expect(store.frame.value?.vehicles.V1.encoders.ticks).toBeInstanceOf(BigInt64Array)
  })

  test('scans and camera images are stored until another Scene', () => {
    const { store, socket } = connectedPage()
    socket.receive({ type: 'Scan', vehicle: 'V1', scan: scanOf([1, 2]) })
    expect([...(store.scans.get('V1')?.ranges ?? [])]).toEqual([1, 2])
    socket.receive(sceneOf(['V1'], 'mini_map'))
    expect(store.scans.size).toBe(0)
    expect(store.scene.value?.scenario).toBe('mini_map')
  })

  test('a scan from before a change of the map is not shown, until there is a new one', () => {
    const { store, socket } = connectedPage()
    const own = { open: false, length: null, width: null, height: null, z: 0, mass: null }
    const mapped = (x: number): Scene => {
      const road = { type: 'MapModule' as const, module: 'straight', x, y: 0, yaw: 0, ...own }
      const lists = { problems: [], props: [], advice: [], faces: {} }
      return { ...sceneOf(['V1']), map_scene: { parts: { road }, ports: {}, modules: {}, templates: {}, ...lists } }
    }
    const receive = (ranges: readonly number[], time: number) =>
      socket.receive({ type: 'Scan', vehicle: 'V1', scan: scanOf(ranges, { time }) })
    socket.receive(mapped(0))
    receive([1, Infinity], 2)
    socket.receive(mapped(0)) // the same map, as after an edit of a vehicle
    receive([1, Infinity], 2)
    expect(store.scans.get('V1')?.time).toBe(2)
    for (const x of [1, 2]) {
      socket.receive(mapped(x))
      receive([1, Infinity], 2)
      expect(store.scans.size).toBe(0)
    }
    receive([3, Infinity], 2) // a LIDAR that was changed scans again at once
    expect([...(store.scans.get('V1')?.ranges ?? [])]).toEqual([3, Infinity])
    socket.receive(mapped(0))
    receive([3, Infinity], 2.1)
    expect(store.scans.get('V1')?.time).toBe(2.1)
  })

  test('the selected vehicle stays selected if the next Scene has it', () => {
    const { store, socket } = connectedPage(['V1', 'V2'])
    store.vehicle.value = 'V2'
    socket.receive(sceneOf(['V1', 'V2'], 'night'))
    expect(store.vehicle.value).toBe('V2')
    socket.receive(sceneOf(['V1']))
    expect(store.vehicle.value).toBe('V1')
  })

  test('events are kept until the next ones', () => {
    const { store, socket } = connectedPage()
    const events = [{ type: 'OffRoad' as const, time: 1, vehicle: 'V1', position: new Float64Array(3) }]
    socket.receive(frameOf(['V1'], { events }))
    socket.receive(frameOf(['V1']))
    expect(store.events.value).toEqual(events)
  })

  test('an error without a request becomes a notice', () => {
    const { store, socket } = connectedPage()
    socket.receive({
      type: 'Error',
      code: 'taken',
      text: 'another browser drives V1; V1 is free 2 s after the last key of that browser',
      id: null,
    })
    expect(store.warning.value).toBe('another browser drives V1; V1 is free 2 s after the last key of that browser')
  })
})

describe('requests', () => {
  test('resolve to the Response with the Frame after them', async () => {
    const { store, connection, socket } = connectedPage()
    const done = connection.request({ type: 'Pause' })
    socket.respond(frameOf(['V1'], { tick: 9 }))
    expect((await done).frame.tick).toBe(9)
    expect(store.frame.value?.tick).toBe(9)
  })

  test('reject with the message of the server, and leave others pending', async () => {
    const { connection, socket } = connectedPage()
    const first = connection.request({ type: 'Pause' })
    const second = connection.request({ type: 'Resume' })
    socket.respond('not now')
    await expect(second).rejects.toThrow('not now')
    socket.receive({
      type: 'Response',
      id: socket.of('Request')[0].id,
      frame: frameOf(),
      text: '',
      curves: {},
      files: {},
      picture: new Uint8Array(),
    })
    await expect(first).resolves.toBeTruthy()
  })

  test('reject if there is no connection', async () => {
    const { connection } = newPage()
    await expect(connection.request({ type: 'Pause' })).rejects.toThrow('not connected')
  })

  test('reject if the connection is lost', async () => {
    const { connection, socket } = connectedPage()
    const done = connection.request({ type: 'Pause' })
    socket.close()
    await expect(done).rejects.toThrow('was lost')
  })
})

test('what another client changed is a notice once, and what this page changed is none', () => {
  const { store, socket } = connectedPage()
  const notices: string[] = []
  store.notice.watch((text) => text && notices.push(text))
  const change = 'page 2 has changed the weather'
  for (const changes of [1, 1, 2]) socket.receive(statusOf({ change, changes }))
  socket.receive(statusOf({ change: 'page-1 has paused the simulation', changes: 3 }))
  expect(notices).toEqual([`${change}.`, `${change}.`])
})

test('drawings are kept by name until they are removed or the scene changes', () => {
  const { store, socket } = connectedPage(['V1'])
  const drawing: Drawing = {
    kind: 'points',
    points: [[0, 0, 1]],
    color: [1, 0, 0, 1],
    text: '',
    size: 1,
    lifetime: null,
  }
  for (const name of ['a', 'b']) socket.receive({ type: 'Drawn', name, drawing, until: 3 })
  expect([...store.drawings.keys()]).toEqual(['a', 'b'])
  socket.receive({ type: 'Drawn', name: 'a', drawing: null, until: 0 })
  expect([...store.drawings.keys()]).toEqual(['b'])
  socket.receive(sceneOf(['V1']))
  expect(store.drawings.size).toBe(0)
})

describe('reconnection', () => {
  test('delays double up to two seconds, and start again after a Welcome', () => {
    newPage()
    for (const delay of [200, 400, 800, 1600, 2000, 2000]) {
      const count = FakeSocket.all.length
      FakeSocket.latest.close()
      vi.advanceTimersByTime(delay - 1)
      expect(FakeSocket.all.length).toBe(count)
      vi.advanceTimersByTime(1)
      expect(FakeSocket.all.length).toBe(count + 1)
    }
    FakeSocket.latest.open()
    FakeSocket.latest.receive(welcome())
    FakeSocket.latest.close()
    vi.advanceTimersByTime(200)
    expect(FakeSocket.latest.readyState).toBe(0)
  })

  test('the state of the link and its reason are shown, and the last Frame stays', () => {
    const { store, socket } = connectedPage()
    const frame = store.frame.value
    socket.close()
    expect(store.link.value).toBe('lost')
    expect(store.connectionError.value).toContain('simulator.test:8730')
    vi.advanceTimersByTime(200)
    expect(store.link.value).toBe('lost')
    expect(store.frame.value).toBe(frame)
    FakeSocket.latest.open()
    FakeSocket.latest.receive(welcome())
    expect(store.link.value).toBe('open')
  })

  test('the subscription is sent again', () => {
    const { connection, socket } = connectedPage()
    connection.subscribe({ scans: true })
    connection.subscribe({ frame_rate: 5 })
    socket.close()
    vi.advanceTimersByTime(200)
    FakeSocket.latest.open()
    expect(FakeSocket.latest.of('Subscribe')).toEqual([
      { type: 'Subscribe', drawings: true, ways: true, scans: true, frame_rate: 5 },
    ])
  })

  test('a refused protocol version is the reason that is shown', () => {
    const { store } = newPage()
    FakeSocket.latest.open()
    FakeSocket.latest.receive({ type: 'Error', code: 'version', text: 'reload the page', id: null })
    FakeSocket.latest.close()
    expect(store.connectionError.value).toBe('reload the page')
  })

  test('messages are not sent while there is no connection', () => {
    const { connection, socket } = connectedPage()
    const count = socket.sent.length
    socket.close()
    connection.subscribe({ scans: true })
    expect(socket.sent.length).toBe(count)
  })
})

test('Status is stored', () => {
  const { store, socket } = connectedPage()
  socket.receive(statusOf({ is_paused: true, clients: 3 }))
  expect(store.status.value).toMatchObject({ is_paused: true, clients: 3 })
})

describe('a connection that passes no data', () => {
  test('counts as lost after 3 s, and as open when data comes', () => {
    const { store, socket } = connectedPage()
    vi.advanceTimersByTime(2500)
    expect(store.link.value).toBe('open')
    vi.advanceTimersByTime(1000)
    expect(store.link.value).toBe('lost')
    expect(store.connectionError.value).toContain('No data has come from the simulator')
    socket.receive(statusOf())
    expect(store.link.value).toBe('open')
  })

  test('gives up its requests after 5 s, and says so', async () => {
    const { store, connection, socket } = connectedPage()
    const done = expect(connection.request({ type: 'Pause' })).rejects.toThrow('no answer for 5 s')
    vi.advanceTimersByTime(4500)
    await expect(connection.request({ type: 'Resume' })).rejects.toThrow('not connected')
    vi.advanceTimersByTime(1000)
    await done
    socket.receive({ type: 'Error', code: 'request', text: 'came 20 s late', id: socket.of('Request')[0].id })
    expect(store.warning.value).toBe('')
  })

  test('is replaced after 10 s', () => {
    const { store, socket } = connectedPage()
    const count = FakeSocket.all.length
    vi.advanceTimersByTime(10_500)
    expect(socket.readyState).toBe(3)
    expect(FakeSocket.all.length).toBe(count + 1)
    FakeSocket.latest.open()
    FakeSocket.latest.receive(welcome())
    expect(store.link.value).toBe('open')
    FakeSocket.latest.receive(statusOf())
    vi.advanceTimersByTime(2500)
    expect(store.link.value).toBe('open')
  })

  test('requests name the Status that the page knew', () => {
    const { connection, socket } = connectedPage()
    socket.receive(statusOf({ clock: 42.5 }))
    void connection.request({ type: 'Pause' })
    expect(socket.of('Request').at(-1)?.heard).toBe(42.5)
  })
})
