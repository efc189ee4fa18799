import { beforeEach, expect, test, vi } from 'vitest'

import { requestRemoteView } from '../src/remote_view'
import { RemoteImage } from '../src/scene/remote_image'
import { zoomCamera } from '../src/scene/zoom'
import { connectedPage, FakeSocket, frameOf, sceneOf, statusOf, welcome } from './support'

beforeEach(() => document.body.replaceChildren())

const settle = () => new Promise((done) => setTimeout(done))

async function page() {
  const all = connectedPage()
  const canvas = document.body.appendChild(document.createElement('canvas'))
  requestRemoteView(all.store, all.connection, canvas)
  await settle()
  return { ...all, canvas }
}

test('nothing is requested unless the quality is stream', async () => {
  const { store, socket } = await page()
  store.camera.value = 'Orbit'
  await settle()
  expect(socket.of('Request')).toEqual([])
})

test('changes of one task make one request', async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  store.camera.value = "Bird's Eye"
  store.birdHeight.value = 4
  await settle()
  expect(socket.of('Request').length).toBe(1)
  expect(socket.request).toMatchObject({ type: 'SetCamera', camera: "Bird's Eye", vehicle: 'V1', height: 4 })
})

test("Driver's Eye zooms with its focal length", async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  zoomCamera(store, 1)
  await settle()
  expect(socket.request).toMatchObject({ camera: "Driver's Eye", zoom: expect.closeTo(1.1) })
})

test('Fly is requested with its place and direction, and without one until it has one', async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  store.camera.value = 'Fly'
  await settle()
  expect(socket.request).not.toHaveProperty('position')
  store.fly.value = { x: 1, y: 2, z: 3, azimuth: 0.4, elevation: -0.2 }
  await settle()
  expect(socket.request).toMatchObject({ camera: 'Fly', position: [1, 2, 3], azimuth: 0.4, elevation: -0.2 })
})

test('its images are as wide as the window, and narrower while they come too slowly', async () => {
  const { store, socket, canvas } = await page()
  Object.defineProperty(canvas, 'clientWidth', { value: 1600 })
  store.quality.value = 'stream'
  await settle()
  expect(socket.request).toMatchObject({ width: 1600 })
  const clock = vi.spyOn(performance, 'now')
  let now = 1e6
  const receive = async (period: number, seconds: number) => {
    for (const end = now + 1000 * seconds; now < end; now += 1000 * period) {
      clock.mockReturnValue(now)
      socket.receive(statusOf())
      store.rendered.value = { jpeg: new Uint8Array(), time: 0 } as never
      await settle()
    }
    return (socket.request as unknown as { width: number }).width
  }
  expect(await receive(1 / 5, 4)).toBe(1200)
  expect(await receive(1 / 10, 4)).toBe(800)
  expect(await receive(1 / 14, 7)).toBe(800) // the next step would be too slow again
  expect(await receive(1 / 40, 4)).toBe(1200)
  clock.mockRestore()
})

test('it ends when another quality is chosen', async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  await settle()
  store.quality.value = 'low'
  await settle()
  expect(socket.request).toEqual({ type: 'SetCamera', camera: null })
})

test('it is requested again after a reconnection', async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  await settle()
  socket.respond(frameOf())
  await settle()
  vi.useFakeTimers()
  socket.close()
  vi.advanceTimersByTime(200)
  vi.useRealTimers()
  FakeSocket.latest.open()
  FakeSocket.latest.receive(welcome())
  FakeSocket.latest.receive(sceneOf(['V1']))
  await settle()
  expect(FakeSocket.latest.request).toMatchObject({ type: 'SetCamera', camera: "Driver's Eye" })
})

test('the page renders with low quality if the simulator cannot', async () => {
  const { store, socket } = await page()
  store.quality.value = 'stream'
  await settle()
  socket.respond('no OpenGL')
  await settle()
  expect(store.quality.value).toBe('low')
  expect(store.warning.value).toBe('no OpenGL')
})

test('the Orbit camera turns with the mouse, and zooms', async () => {
  const { store, socket, canvas } = await page()
  store.quality.value = 'stream'
  store.camera.value = 'Orbit'
  await settle()
  const before = socket.request as unknown as { azimuth: number; distance: number }
  canvas.dispatchEvent(Object.assign(new Event('pointermove'), { buttons: 1, movementX: 10, movementY: 1000 }))
  zoomCamera(store, -1)
  await settle()
  expect(socket.request).toMatchObject({
    azimuth: expect.closeTo(before.azimuth - 0.06),
    elevation: 1.5,
    distance: expect.closeTo(before.distance * 1.1),
    zoom: 1,
  })
})

test('of images that arrive while one is decoded, only the latest is shown', async () => {
  const canvas = document.body.appendChild(document.createElement('canvas'))
  const decoded: string[] = []
  let finish = (): void => {}
  vi.stubGlobal('createImageBitmap', async (blob: Blob) => {
    const text = await blob.text()
    await new Promise<void>((done) => (finish = done))
    if (text === 'broken') throw new Error('not a JPEG')
    decoded.push(text)
    return { width: 4, height: 3, close: () => {} }
  })
  const view = new RemoteImage(canvas)
  const onImage = vi.fn()
  view.onImage = onImage
  for (const text of ['1', '2', 'broken', '4']) view.show({ time: 0, jpeg: new TextEncoder().encode(text) })
  for (let i = 0; i < 3; i++) {
    await settle()
    finish()
  }
  await settle()
  expect(decoded).toEqual(['1', '4'])
  view.show({ time: 0, jpeg: new TextEncoder().encode('broken') })
  await settle()
  finish()
  await settle()
  expect(onImage).toHaveBeenCalledTimes(2)
  view.dispose()
  expect(document.querySelectorAll('canvas').length).toBe(1)
})
