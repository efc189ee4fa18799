// The depth or the labels of what a sensor camera sees, rendered by the simulator on demand, with a legend.
import type { Connection } from '../connection'
import type { Store } from '../store'
import { h, setText } from './element'
import { choice, setOptions } from './fields'
import { rangeScale } from './range_scale'

/** Width [pixels] and rate [Hz] of the images. */
const WIDTH = 480
const RATE = 5
/** Depth at which the colours end [m], unless the LIDAR points have another range. */
const FARTHEST = 10
const NONE = ''

/** A choice of camera and content, the image and its legend; `isShown`: whether anybody can see it. */
export function sensorView(
  store: Store,
  connection: Connection,
): { element: HTMLElement; show: (isShown: boolean) => void } {
  const select = choice('hud-sensor-view', send, {
    'aria-label': 'Depth and labels',
    title: 'Depth or labels of a camera, as the simulator renders them. It costs processor time only while it is shown',
  })
  const canvas = h('canvas', { width: 320, height: 180, role: 'img', testid: 'hud-sensor-view-image' })
  const state = h('span', { class: 'sensor-view-state', role: 'status' })
  const scale = rangeScale('Depth', store.depthFarthest)
  const labels = h('ul', { class: 'label-colours', testid: 'label-colours' })
  const figure = h('figure', { class: 'sensor-view', hidden: true }, canvas, state, scale, labels)
  const element = h('div', { class: 'sensor-views' }, select, figure)
  let isShown = false
  let isAsked = false
  let isDrawing = false

  function send(): void {
    const [content, camera] = select.value.split('/')
    const isWanted = isShown && select.value !== NONE && store.link.value === 'open'
    figure.hidden = select.value === NONE
    scale.hidden = content !== 'depth'
    labels.hidden = content !== 'labels'
    canvas.setAttribute('aria-label', `${content === 'depth' ? 'Depth' : 'Labels'} of the ${camera} camera`)
    if (!isWanted && !isAsked) return
    isAsked = isWanted
    if (!isWanted) {
      void connection.request({ type: 'ViewSensor', camera: null }).catch(() => {})
      return
    }
    setText(state, 'starting…')
    store.depthFarthest.value = store.scanFarthest.value || FARTHEST
    const view = { vehicle: store.vehicle.value, width: WIDTH, rate: RATE, farthest: store.depthFarthest.value }
    connection
      .request({ type: 'ViewSensor', camera, content: content as 'depth' | 'labels', ...view })
      .catch((error: Error) => setText(state, error.message))
  }

  async function draw(jpeg: Uint8Array): Promise<void> {
    isDrawing = true
    const bitmap = await createImageBitmap(new Blob([jpeg.slice()], { type: 'image/jpeg' })).catch(() => null)
    isDrawing = false
    if (!bitmap) return
    ;[canvas.width, canvas.height] = [bitmap.width, bitmap.height]
    canvas.getContext('2d')?.drawImage(bitmap, 0, 0)
    bitmap.close()
    setText(state, '')
  }

  function options(): void {
    const cameras = store.scene.value?.vehicles[store.vehicle.value]?.cameras ?? []
    const of = (content: string, name: string) =>
      cameras.map((camera) => [`${content}/${camera}`, `${name}: ${camera}`])
    setOptions(select, {
      [NONE]: 'No depth or labels',
      ...Object.fromEntries([...of('depth', 'Depth'), ...of('labels', 'Labels')]),
    })
    if (!select.value) select.value = NONE
    send()
  }

  store.sensorView.watch((view) => view && isAsked && !isDrawing && void draw(view.jpeg))
  store.scene.watch((scene) => {
    isAsked = false // another World, or the server, has no view for this page
    labels.replaceChildren(
      ...Object.entries(scene?.label_colours ?? {}).map(([name, colour]) =>
        h('li', {}, h('i', { style: `background: ${colour}` }), name),
      ),
    )
    options()
  })
  store.vehicle.watch(options)
  store.link.watch((link) => {
    if (link !== 'open') isAsked = false
  })
  store.scanFarthest.watch((farthest) => isAsked && farthest && farthest !== store.depthFarthest.value && send())
  return {
    element,
    show(now) {
      if (now === isShown) return
      isShown = now
      send()
    },
  }
}
