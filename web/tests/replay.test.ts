// The timeline of a recording: what it shows between two messages, and what it asks for. In a browser: tests/page.
import { beforeEach, expect, test } from 'vitest'

import type { Event } from '../src/messages'
import { VehicleEvents } from '../src/panels/vehicle_events'
import { textAt } from '../src/replay/marks'
import { Playhead } from '../src/replay/playhead'
import { TimeWindow } from '../src/replay/window'
import { connectedPage, frameOf, sceneOf, statusOf } from './support'

let now = 0
beforeEach(() => {
  now = 0
})

function collision(time: number): { time: number; event: Event } {
  return {
    time,
    event: { type: 'Collision', time: 0, vehicle: 'V1', other: 'wall', impulse: 1, position: new Float64Array(3) },
  }
}

/** A page that shows a recording of 100 s with collisions at 10, 20 and 20.5 s. */
function replay() {
  const { store, connection, socket } = connectedPage()
  const timeline = { name: 'lap.mcap', duration: 100, marks: [collision(10), collision(20), collision(20.5)] }
  socket.receive({ ...sceneOf(['V1']), timeline })
  const failures: unknown[] = []
  const playhead = new Playhead(
    store,
    connection,
    (error) => failures.push(error),
    () => now,
  )
  const show = (position: number, is_paused = false, speed = 1) =>
    socket.receive(statusOf({ position, is_paused, speed }))
  return { playhead, socket, show, failures }
}

test('time passes between two messages of the server, at the speed, and not in a pause or after the end', () => {
  const { playhead, show } = replay()
  show(10, false, 4)
  now = 500
  expect(playhead.position).toBe(12)
  show(99, false, 4)
  now = 2000
  expect(playhead.position).toBe(100)
  show(40, true)
  now = 9000
  expect(playhead.position).toBe(40)
})

test('many moves of the scrubber ask for the latest place only, one at a time', async () => {
  const { playhead, socket, show } = replay()
  show(0, true)
  for (const time of [5, 6, 7, 1000]) playhead.seek(time)
  expect(socket.of('Request').map(({ operation }) => operation)).toEqual([{ type: 'Seek', time: 5 }])
  show(5, true) // a Status of the first place does not pull the scrubber back
  expect(playhead.position).toBe(100)
  socket.respond(frameOf())
  await Promise.resolve()
  await Promise.resolve()
  expect(socket.request).toEqual({ type: 'Seek', time: 100 })
})

test('a place that is refused is left again, with the reason', async () => {
  const { playhead, socket, show, failures } = replay()
  show(3, true)
  playhead.seek(50)
  socket.respond('the file is damaged there')
  await new Promise((done) => setTimeout(done))
  expect(failures.map(String)).toEqual(['Error: the file is damaged there'])
  expect(playhead.position).toBe(3)
})

test('jumps go to the next and the previous event, and stay at the last one', () => {
  const { playhead, show } = replay()
  show(10, true)
  expect([1, 1, 1].map(() => playhead.jump(1)?.time)).toEqual([20, 20.5, undefined])
  expect([1, 1, 1].map(() => playhead.jump(-1)?.time)).toEqual([20, 10, undefined])
})

test('the wheel enlarges around the pointer, within the recording, and the window follows the time that is played', () => {
  const window_ = new TimeWindow()
  window_.showAll(7200)
  window_.zoom(10, 0.25)
  expect(window_.timeAt(0.25)).toBeCloseTo(1800)
  expect(window_.isWhole).toBe(false)
  window_.zoom(1000, 0.5)
  expect(window_.range.value.end - window_.range.value.start).toBeCloseTo(2)
  window_.follow(7199.9)
  expect(window_.range.value.end).toBeCloseTo(7200)
  expect(window_.shareOf(7199.9)).toBeGreaterThan(0)
  window_.zoom(-1000, 0.5)
  expect(window_.range.value).toEqual({ start: 0, end: 7200 })
})

test('a place of the timeline is named by its event if one is near', () => {
  const window_ = new TimeWindow()
  window_.showAll(100)
  const timeline = { name: 'lap.mcap', duration: 100, marks: [collision(10), collision(20)] }
  const scene = { ...sceneOf(['V1']), timeline }
  expect(textAt(scene, window_, 0.102, 1000)).toBe('00:00:10.00 V1 hit the wall')
  expect(textAt(scene, window_, 0.15, 1000)).toBe('00:00:15.00')
})

test('a seek shows whether a vehicle was off the road there, and forgets what was before a reset', () => {
  const event = (type: 'OffRoad' | 'BackOnRoad', at: number, time: number) => ({
    time: at,
    event: { type, time, vehicle: 'V1', position: new Float64Array(3) },
  })
  // a reset at 30 s sets the time back to 0
  const marks = [
    event('OffRoad', 10, 10),
    event('BackOnRoad', 20, 20),
    event('OffRoad', 25, 25),
    event('OffRoad', 40, 10),
  ]
  const events = new VehicleEvents()
  const isOff = (position: number, time: number) => {
    events.showRecorded(marks, position, time, 0.2)
    return events.isOffRoad('V1')
  }
  expect([isOff(15, 15), isOff(5, 5), isOff(22, 22), isOff(26, 26)]).toEqual([true, false, false, true])
  expect([isOff(31, 1), isOff(41, 11)]).toEqual([false, true])
})
