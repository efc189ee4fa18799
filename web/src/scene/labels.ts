// The name of each vehicle above it, if there are several. HTML over the canvas: sharp text and no draw calls.
import { Vector3 } from 'three'

import type { Scene } from '../messages'
import { hasSeveralVehicles, vehicleColour } from '../vehicle_colours'
import type { PlacedObject } from './motion'

/** Distance of a label from the middle of its vehicle, upwards in the image, in half lengths of the vehicle. */
const DISTANCE = 1.6

/** A label is shown up to this distance of its vehicle from the camera [m]. */
const FARTHEST = 15
/** The label of a car of the traffic is shown while the pointer is so near to the middle of the car [CSS pixels]. */
const POINTED = 48
/** Height of a label, and widths of a letter and of its edges [CSS pixels]: measuring them would cost a layout. */
const HEIGHT = 20
const LETTER = 8
const EDGES = 21

/** What decides which labels are shown. */
export interface LabelView {
  /** The vehicle that the camera follows. */
  viewed: string
  /** Whether the camera is so near to that vehicle that everybody knows which one it is. */
  isOwnHidden: boolean
  /** Whether labels of far vehicles are shown, too. */
  isFarShown: boolean
  /** The place of the pointer [CSS pixels]. */
  pointer: readonly [x: number, y: number]
  eye: Vector3
  project: Projection
  /** The direction in the map of up in the image. */
  up: Vector3
}

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
  private readonly labels = new Map<string, Entry>()

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
    for (const [name, { half_length, wheelbase, is_traffic }] of Object.entries(scene.vehicles)) {
      const element = document.createElement('span')
      element.dataset.vehicle = name
      element.textContent = name
      const colour = vehicleColour(scene, name)
      element.style.setProperty('--vehicle', colour)
      this.element.append(element)
      const label = { text: name, colour, place: null }
      const [ahead, distance] = [0.5 * wheelbase, DISTANCE * half_length]
      this.labels.set(name, { label, element, ahead, distance, isTraffic: is_traffic })
    }
  }

  /** Moves the labels, and hides those that nobody needs: of far vehicles, and below that of a nearer vehicle. */
  update(vehicles: ReadonlyMap<string, PlacedObject>, isShown: boolean, view: LabelView): void {
    const { viewed, eye } = view
    const away = (name: string): number => vehicles.get(name)?.position.distanceTo(eye) ?? Infinity
    const nearest = [...this.labels].sort(([a], [b]) => (a === viewed ? -1 : b === viewed ? 1 : away(a) - away(b)))
    const taken: Label[] = []
    for (const [name, entry] of nearest) {
      const { label, element } = entry
      const vehicle = vehicles.get(name)
      label.place = isShown && vehicle ? placeOf(name, entry, vehicle, view) : null
      if (label.place && taken.some((other) => overlap(label, other))) label.place = null
      if (label.place) taken.push(label)
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

interface Entry {
  label: Label
  element: HTMLElement
  /** From the origin of the vehicle to its middle, and from there to the label [m]. */
  ahead: number
  distance: number
  isTraffic: boolean
}

/** Where the label of a vehicle is shown [CSS pixels]; null: nowhere. */
function placeOf(name: string, { ahead, distance, isTraffic }: Entry, vehicle: PlacedObject, view: LabelView) {
  if (view.isOwnHidden && name === view.viewed) return null
  top.set(ahead, 0, 0).applyQuaternion(vehicle.orientation).add(vehicle.position)
  if (!view.isFarShown && top.distanceTo(view.eye) > FARTHEST) return null
  if (isTraffic) {
    const middle = view.project(top.x, top.y, top.z)
    if (!middle || Math.hypot(middle[0] - view.pointer[0], middle[1] - view.pointer[1]) > POINTED) return null
  }
  top.addScaledVector(view.up, distance)
  return view.project(top.x, top.y, top.z)
}

function overlap(one: Label, other: Label): boolean {
  if (!one.place || !other.place) return false
  const width = EDGES + (LETTER * (one.text.length + other.text.length)) / 2
  return Math.abs(one.place[0] - other.place[0]) < width && Math.abs(one.place[1] - other.place[1]) < HEIGHT
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
