// The name of each vehicle above it, if there are several. HTML over the canvas: sharp text and no draw calls.
import { Vector3 } from 'three'

import type { Scene } from '../messages'
import { hasSeveralVehicles, vehicleColour } from '../vehicle_colours'
import type { PlacedObject } from './motion'

/** Distance of a label from the middle of its vehicle, upwards in the image, in half lengths of the vehicle. */
const DISTANCE = 1.6

/** Where a point of the map [m] is on the screen [CSS pixels]; null if it is not in front of the camera. */
export type Projection = (x: number, y: number, z: number) => [x: number, y: number] | null

export interface Label {
  text: string
  colour: string
  /** Position of its lower edge, or null if it is not visible [CSS pixels]. */
  place: [x: number, y: number] | null
}

export class Labels {
  private readonly element = document.createElement('div')
  private readonly labels = new Map<string, { label: Label; element: HTMLElement; ahead: number; distance: number }>()

  constructor(canvas: HTMLElement) {
    this.element.className = 'vehicle-labels'
    this.element.setAttribute('aria-hidden', 'true') // the menu has the names
    canvas.after(this.element)
  }

  /** Makes the labels of a scene. */
  show(scene: Scene | null): void {
    this.labels.clear()
    this.element.replaceChildren()
    if (!scene || !hasSeveralVehicles(scene)) return
    for (const [name, { half_length, wheelbase }] of Object.entries(scene.vehicles)) {
      const element = document.createElement('span')
      element.dataset.vehicle = name
      element.textContent = name
      const colour = vehicleColour(scene, name)
      element.style.setProperty('--vehicle', colour)
      this.element.append(element)
      const label = { text: name, colour, place: null }
      this.labels.set(name, { label, element, ahead: 0.5 * wheelbase, distance: DISTANCE * half_length })
    }
  }

  /** Moves the labels; `viewed`: the vehicle that the camera follows; `up`: the direction in the map of up in the image. */
  update(vehicles: ReadonlyMap<string, PlacedObject>, viewed: string, project: Projection, up: Vector3): void {
    for (const [name, { label, element, ahead, distance }] of this.labels) {
      const vehicle = vehicles.get(name)
      if (vehicle)
        top.set(ahead, 0, 0).applyQuaternion(vehicle.orientation).add(vehicle.position).addScaledVector(up, distance)
      label.place = vehicle ? project(top.x, top.y, top.z) : null
      element.hidden = !label.place
      element.classList.toggle('viewed', name === viewed)
      if (label.place) element.style.translate = label.place.map((value) => `${value.toFixed(1)}px`).join(' ')
    }
  }

  get all(): readonly Label[] {
    return [...this.labels.values()].map(({ label }) => label)
  }

  dispose(): void {
    this.element.remove()
  }
}

/** Draws the labels into a picture with `ratio` pixels per CSS pixel. */
export function drawLabels(context: CanvasRenderingContext2D, labels: readonly Label[], ratio: number): void {
  context.scale(ratio, ratio)
  context.font = '600 13px system-ui, sans-serif'
  context.textBaseline = 'middle'
  for (const { text, colour, place } of labels) {
    if (!place) continue
    const width = context.measureText(text).width + 21
    const [left, top] = [place[0] - width / 2, place[1] - 20]
    context.fillStyle = 'rgb(16 21 27 / 0.86)'
    context.fillRect(left, top, width, 20)
    context.fillStyle = colour
    context.fillRect(left, top, 6, 20)
    context.fillStyle = '#fff'
    context.fillText(text, left + 13, top + 10.5)
  }
}

const top = new Vector3()
