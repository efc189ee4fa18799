// The small map: the drawing of the map with walls and lanes, the driven lines (in a race always), boxes, and an arrow
// for each vehicle.

import type { Scene } from '../messages'
import { sceneUrl } from '../scene/assets'
import { clamp } from '../scene/clamp'
import type { Store } from '../store'
import type { Trails } from '../trails'
import { vehicleColour } from '../vehicle_colours'
import { contextOf } from './canvas'
import { h } from './element'

/** Refresh rate [Hz]. */
const RATE = 8
/** Size of an arrow [CSS pixels]. */
const ARROW = 8

type Context = CanvasRenderingContext2D

export function minimap(store: Store, trails: Trails): HTMLElement {
  const canvas = h('canvas', { class: 'minimap-canvas', role: 'img', 'aria-label': 'Map from above with all vehicles' })
  const element = h(
    'aside',
    { class: 'card minimap', id: 'minimap', testid: 'minimap', 'aria-label': 'Small map', hidden: true },
    canvas,
  )
  let drawing: HTMLImageElement | null = null
  let timer = 0

  function load(scene: Scene | null): void {
    drawing = null
    if (!scene?.plan) return
    const { image: address, bounds } = scene.plan
    const [x0, y0, x1, y1] = bounds
    const longest = Math.max(x1 - x0, y1 - y0)
    canvas.style.setProperty('--width', String((x1 - x0) / longest))
    canvas.style.setProperty('--height', String((y1 - y0) / longest))
    const image = new Image()
    image.onload = () => {
      if (store.scene.value === scene) drawing = image
      draw()
    }
    image.src = sceneUrl(address).href
  }

  function draw(): void {
    const [scene, frame] = [store.scene.value, store.frame.value]
    if (element.hidden || document.hidden || !scene?.plan || !frame) return
    const paper = contextOf(canvas)
    if (!paper) return
    const { context, width, height } = paper
    if (drawing) context.drawImage(drawing, 0, 0, width, height)
    const [x0, , x1, y1] = scene.plan.bounds
    const scale = width / (x1 - x0)
    const at = (x: number, y: number): [number, number] => [(x - x0) * scale, (y1 - y) * scale]
    context.fillStyle = '#f2902b'
    for (const { pose } of Object.values(frame.objects)) {
      const [x, y] = at(pose.position[0], pose.position[1])
      context.fillRect(x - 2, y - 2, 4, 4)
    }
    const isRace = Object.values(frame.vehicles).some(({ race }) => race)
    if (store.areTrailsShown.value || isRace) {
      for (const [name, { points, length }] of trails.all)
        drawTrail(context, points, length, at, vehicleColour(scene, name))
    }
    const viewed = store.vehicle.value
    const names = Object.keys(frame.vehicles).sort((a, b) => Number(a === viewed) - Number(b === viewed))
    for (const name of names) {
      const { position, orientation } = frame.vehicles[name].pose
      const [px, py] = at(position[0], position[1])
      // a vehicle outside the drawing is at its edge
      const place: [number, number] = [clamp(px, [ARROW, width - ARROW]), clamp(py, [ARROW, height - ARROW])]
      const [w, x, y, z] = orientation
      const yaw = Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
      drawArrow(context, place, yaw, vehicleColour(scene, name), name === viewed)
    }
  }

  store.scene.watch(load)
  store.isMapOpen.watch((isOpen) => {
    element.hidden = !isOpen
    window.clearInterval(timer)
    if (!isOpen) return
    timer = window.setInterval(draw, 1000 / RATE)
    draw()
  })
  return element
}

function drawTrail(
  context: Context,
  points: Float32Array,
  length: number,
  at: (x: number, y: number) => [number, number],
  colour: string,
): void {
  context.strokeStyle = colour
  context.lineWidth = 2
  context.beginPath()
  let isPen = false
  for (let i = 0; i < length; i++) {
    const [x, y] = [points[3 * i], points[3 * i + 1]]
    if (isPen) context.lineTo(...at(x, y))
    else context.moveTo(...at(x, y))
    isPen = !Number.isNaN(x)
  }
  context.stroke()
}

/** An arrow with a white rim; the viewed vehicle has a larger one. */
function drawArrow(context: Context, [x, y]: [number, number], yaw: number, colour: string, isViewed: boolean): void {
  const size = isViewed ? 1.3 * ARROW : ARROW
  context.save()
  context.translate(x, y)
  context.rotate(-yaw)
  context.beginPath()
  context.moveTo(size, 0)
  context.lineTo(-0.7 * size, 0.7 * size)
  context.lineTo(-0.35 * size, 0)
  context.lineTo(-0.7 * size, -0.7 * size)
  context.closePath()
  context.strokeStyle = isViewed ? '#000' : '#fff'
  context.lineWidth = 3
  context.lineJoin = 'round'
  context.stroke()
  context.strokeStyle = '#fff'
  context.lineWidth = 1.5
  context.stroke()
  context.fillStyle = colour
  context.fill()
  context.restore()
}
