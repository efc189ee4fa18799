// What programs draw, over the images of the simulator (quality Stream): in two dimensions, in front of everything.
import { type PerspectiveCamera, Vector3 } from 'three'

import type { Drawing } from '../messages'
import type { Store } from '../store'

/** Least width of a line and diameter of a point [CSS pixels]. */
const LEAST = 2

export class FlatDrawings {
  private readonly canvas = document.createElement('canvas')
  private readonly context = this.canvas.getContext('2d')

  constructor(private readonly below: HTMLCanvasElement) {
    this.canvas.setAttribute('aria-hidden', 'true')
    this.canvas.style.cssText = 'position:absolute;pointer-events:none;display:none'
    below.after(this.canvas)
  }

  /** Draws what the store has as the camera sees it; `isStream`: otherwise nothing. */
  update(store: Store, camera: PerspectiveCamera, isStream: boolean): void {
    const isShown = isStream && store.areDrawingsShown.value && store.drawings.size > 0
    this.canvas.style.display = isShown ? 'block' : 'none'
    const { context, canvas, below } = this
    if (!isShown || !context) return
    const { offsetLeft: left, offsetTop: top, clientWidth: width, clientHeight: height } = below
    Object.assign(canvas.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` })
    ;[canvas.width, canvas.height] = [width * devicePixelRatio, height * devicePixelRatio] // this clears it
    context.scale(devicePixelRatio, devicePixelRatio)
    const time = store.frame.value?.time ?? 0
    for (const { drawing, until } of store.drawings.values())
      if (drawing && until > time) draw(context, drawing, camera, width, height)
  }

  /** Adds what is shown to a picture of that size. */
  addTo(context: CanvasRenderingContext2D, width: number, height: number): void {
    if (this.canvas.style.display !== 'none') context.drawImage(this.canvas, 0, 0, width, height)
  }

  dispose(): void {
    this.canvas.remove()
  }
}

function draw(
  context: CanvasRenderingContext2D,
  { kind, points, text = '', color = [1, 0.58, 0, 1], size = 0.02 }: Drawing,
  camera: PerspectiveCamera,
  width: number,
  height: number,
): void {
  const focus = 0.5 * height * camera.projectionMatrix.elements[5]
  const see = ([x, y, z]: readonly number[]) => new Vector3(x, y, z).applyMatrix4(camera.matrixWorldInverse)
  const place = ({ x, y, z }: Vector3): [number, number] => [
    0.5 * width - (focus * x) / z,
    0.5 * height + (focus * y) / z,
  ]
  const [red, green, blue, opacity] = color
  const style = `rgb(${255 * red} ${255 * green} ${255 * blue} / ${opacity})`
  context.fillStyle = context.strokeStyle = style
  context.lineCap = context.lineJoin = 'round'
  if (kind === 'points' || kind === 'text') {
    for (const seen of points.map(see)) {
      if (seen.z > -camera.near) continue
      const pixels = (focus * size) / -seen.z
      const [x, y] = place(seen)
      if (kind === 'text') {
        context.font = `600 ${0.8 * pixels}px ui-monospace, monospace`
        context.textAlign = 'center'
        context.textBaseline = 'middle'
        context.fillText(text, x, y)
        continue
      }
      context.beginPath()
      context.arc(x, y, 0.5 * Math.max(pixels, LEAST), 0, 2 * Math.PI)
      context.fill()
    }
    return
  }
  for (let i = 0; i + 1 < points.length; i += kind === 'path' ? 1 : 2) {
    const line = clippedLine(see(points[i]), see(points[i + 1]), -camera.near)
    if (!line) continue
    context.lineWidth = Math.max((focus * size) / (-0.5 * (line[0].z + line[1].z)), LEAST)
    context.beginPath()
    context.moveTo(...place(line[0]))
    context.lineTo(...place(line[1]))
    context.stroke()
  }
}

/** The part of a line in front of the camera, whose near plane is at that z; null if there is none. */
export function clippedLine(a: Vector3, b: Vector3, near: number): [Vector3, Vector3] | null {
  if (a.z > near && b.z > near) return null
  const cut = (from: Vector3, to: Vector3) => from.clone().lerp(to, (near - from.z) / (to.z - from.z))
  return [a.z > near ? cut(a, b) : a, b.z > near ? cut(b, a) : b]
}
