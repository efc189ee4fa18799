import { beforeEach, expect, test, vi } from 'vitest'

import { tour } from '../src/panels/tour'
import { connectedPage, frameOf, pose, statusOf, vehicleOf } from './support'

beforeEach(() => {
  localStorage.clear()
  document.body.replaceChildren()
  vi.useFakeTimers()
  return () => vi.useRealTimers()
})

function get<Kind extends HTMLElement = HTMLElement>(testid: string): Kind {
  const found = document.querySelector<Kind>(`[data-testid='${testid}']`)
  if (!found) throw new Error(`no element '${testid}'`)
  return found
}

function page() {
  const all = connectedPage()
  const { element, start } = tour(all.store, () => {})
  document.body.append(element)
  const at = (x: number, changes = {}) =>
    all.socket.receive(frameOf([], { vehicles: { V1: vehicleOf({ pose: pose(x), ...changes }) } }))
  return { ...all, element, start, at }
}

const title = () => get('tour-title').textContent
const next = () => vi.advanceTimersByTime(1000)

test('is offered once the simulation is shown, and not again', () => {
  const { element, socket, at } = page()
  at(0)
  socket.receive(statusOf())
  expect(element.hidden).toBe(false)
  expect(title()).toBe('A tour of 60 seconds?')
  get('tour-no').click()
  expect(element.hidden).toBe(true)
  document.body.replaceChildren()
  const again = page()
  again.at(0)
  again.socket.receive(statusOf())
  expect(again.element.hidden).toBe(true)
})

test('is not offered in a replay', () => {
  const { store } = connectedPage()
  store.status.value = null
  const { element } = tour(store, () => {})
  store.status.value = statusOf({ position: 0 })
  expect(element.hidden).toBe(true)
  store.status.value = statusOf()
  expect(element.hidden).toBe(false)
})

test('the first step waits until a person has driven a metre; a reset is no way', () => {
  const { start, at } = page()
  at(0)
  start()
  expect(title()).toBe('Drive a metre')
  for (const x of [0.3, 0.6]) at(x)
  expect(get('tour-progress').textContent).toBe('0.6 of 1 m')
  at(-8)
  expect(get('tour-progress').textContent).toBe('0.6 of 1 m')
  at(-8.3, { is_autonomous: true })
  expect(get('tour-progress').textContent).toContain('A program drives')
  at(-8)
  for (const x of [-7.8, -7.5]) at(x)
  expect(get('tour-progress').textContent).toBe('Done')
  next()
  expect(title()).toBe('Look from another camera')
})

test('each step ends by its action', () => {
  const { store, socket, start, at } = page()
  at(0)
  start()
  for (const x of [0.5, 1.1]) at(x)
  next()
  store.camera.value = 'Orbit'
  next()
  expect(title()).toBe('Let it rain')
  const rain = { clouds: 1, fog: 0, rain: 0.8, snow: 0, wind: 0, wetness: 0, snow_cover: 0 }
  socket.receive(frameOf(['V1'], { weather: rain }))
  next()
  expect(title()).toBe('Put a box on the road')
  store.isEditing.value = true
  socket.receive(frameOf(['V1'], { weather: rain, objects: { box_1: { pose: pose(1) } } as never }))
  next()
  expect(title()).toBe('Drive on')
  store.isEditing.value = false
  next()
  expect(title()).toBe('Record')
  const { recording } = statusOf()
  socket.receive(statusOf({ recording: { ...recording, state: 'recording' } }))
  next()
  expect(title()).toBe('Stop the recording')
  socket.receive(statusOf())
  next()
  expect(title()).toBe('Replay it')
  const replay = document.createElement('button')
  replay.dataset.testid = 'recorded-replay'
  document.body.append(replay)
  replay.click()
  socket.receive(statusOf())
  next()
  expect(title()).toBe('That was the tour')
  get('tour-end').click()
  expect(get('tour').hidden).toBe(true)
})
