// What the page shows of a request that is not answered yet, and of one that is refused.
import { beforeEach, expect, test } from 'vitest'

import { Actions } from '../src/actions'
import { bridge } from '../src/panels/bridge'
import { toolbar } from '../src/panels/toolbar'
import { recorder } from '../src/replay/recorder'
import { connectedPage, frameOf, statusOf } from './support'

beforeEach(() => {
  localStorage.clear()
  document.body.replaceChildren()
})

function get<Kind extends HTMLElement = HTMLButtonElement>(testid: string): Kind {
  const found = document.querySelector<Kind>(`[data-testid='${testid}']`)
  if (!found) throw new Error(`no element '${testid}'`)
  return found
}

const settle = () => new Promise((done) => setTimeout(done))
const recording = { state: 'recording', file: 'a.mcap', duration: 1, size: 0, dropped: 0, error: '' } as const

test('Record shows at once that it waits, a second press does nothing, and the press after the Status stops', async () => {
  const { store, connection, socket } = connectedPage()
  const { button, touchButton, section } = recorder(store, new Actions(store, connection))
  document.body.append(button, touchButton, section)
  get('record-button').click()
  for (const testid of ['record-button', 'touch-record', 'record']) expect(get(testid).ariaBusy).toBe('true')
  for (const testid of ['record-button', 'touch-record', 'record']) get(testid).click()
  expect(socket.of('Request').map(({ operation }) => operation.type)).toEqual(['StartRecording'])
  socket.respond(frameOf())
  await settle()
  get('record-button').click() // the page does not know yet that it records
  expect(socket.of('Request')).toHaveLength(1)
  socket.receive(statusOf({ recording }))
  await settle()
  expect(get('record-button').ariaBusy).toBe('false')
  get('record-button').click()
  expect(socket.request).toEqual({ type: 'StopRecording' })
})

test('Record can be used again after a failure', async () => {
  const { store, connection, socket } = connectedPage()
  document.body.append(recorder(store, new Actions(store, connection)).button)
  get('record-button').click()
  socket.respond('the disk is full')
  await settle()
  expect(store.error.value).toBe('The disk is full.')
  expect(get('record-button').ariaBusy).toBe('false')
  get('record-button').click()
  expect(socket.of('Request')).toHaveLength(2)
})

test('Connect shows that it waits for the answer', async () => {
  const { store, connection, socket } = connectedPage()
  document.body.append(bridge(store, connection, () => {}))
  const submit = () =>
    document.querySelector('form')?.dispatchEvent(new Event('submit', { cancelable: true, bubbles: true }))
  submit()
  submit()
  expect(get('connect').ariaBusy).toBe('true')
  expect(socket.of('Request')).toHaveLength(1)
  socket.respond('no such host')
  await settle()
  expect(get('connect').ariaBusy).toBe('false')
})

test('a button whose operation is refused is disabled, and its tooltip says why', () => {
  const { store, connection, socket } = connectedPage()
  const actions = new Actions(store, connection)
  document.body.append(toolbar(store, actions, recorder(store, actions).button, () => {}))
  store.isBuilding.value = true
  const usual = get('build-button').title
  socket.receive(statusOf({ refused: { UseMap: 'a race is in progress', StartRecording: 'not in a race' } }))
  expect(store.isBuilding.value).toBe(false)
  expect(get('build-button').disabled).toBe(true)
  expect(get('build-button').title).toBe('A race is in progress.')
  expect(get('record-button').title).toBe('Not in a race.')
  expect(get('edit-button').disabled).toBe(false)
  store.isBuilding.value = true // a key, or a map in a link
  expect(store.isBuilding.value).toBe(false)
  expect(store.notice.value).toBe('a race is in progress')
  socket.receive(statusOf())
  expect([get('build-button').disabled, get('build-button').title]).toEqual([false, usual])
  store.isBuilding.value = true
  expect(store.isBuilding.value).toBe(true)
})
