// Outlines of vehicles and objects on the screen: what the pointer hits, and what the overlay draws.
import type { Pose, Scene } from '../messages'
import type { Placement } from '../store'

export type Point = readonly [x: number, y: number]
/** The place of a point of the map on the screen [CSS pixels]; null behind the camera. */
export type Projection = (x: number, y: number, z: number) => Point | null

/** Distance of the handle from the front of its thing [CSS pixels]. */
const HANDLE_DISTANCE = 38

/** A box around a vehicle or an object, in its own axes [m]. */
export interface Extent {
  /** From the origin of its pose to the middle, along x. */
  ahead: number
  size: readonly [length: number, width: number, height: number]
  /** From the base up to the origin of its pose. */
  below: number
}

/** The extent of a vehicle or an object of the Scene; null if it is not known. */
export function extentOf(scene: Scene | null, name: string): Extent | null {
  const vehicle = scene?.vehicles[name]
  if (vehicle) return { ahead: 0.5 * vehicle.wheelbase, size: vehicle.size, below: vehicle.wheel_radius }
  const size = scene?.object_sizes[name]
  return size ? { ahead: 0, size, below: 0.5 * size[2] } : null
}

/** The pose of a thing that stands on the ground. */
export function poseOf({ x, y, yaw }: Placement, { below }: Extent): Pose {
  const orientation = new Float64Array([Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)])
  return { position: new Float64Array([x, y, below]), orientation }
}

/**
 * The corners on the screen: of the base, counterclockwise from the front left, then those above them; null if one is
 * behind the camera.
 */
export function cornersOf(pose: Pose, extent: Extent, project: Projection): Point[] | null {
  const [length, width, height] = extent.size
  const corners = [0, height].flatMap((z) =>
    CORNERS.map(([x, y]) =>
      project(...inMap(pose, extent.ahead + 0.5 * x * length, 0.5 * y * width, z - extent.below)),
    ),
  )
  return corners.every((corner) => corner !== null) ? corners : null
}

const CORNERS = [
  [1, 1],
  [-1, 1],
  [-1, -1],
  [1, -1],
] as const

/** Where the line to the handle starts and ends on the screen; the end is the handle. */
export function handleOf(pose: Pose, extent: Extent, project: Projection): readonly [Point, Point] | null {
  const middle = project(...inMap(pose, extent.ahead, 0, -extent.below))
  const front = project(...inMap(pose, extent.ahead + 0.5 * extent.size[0], 0, -extent.below))
  if (!middle || !front) return null
  const length = Math.hypot(front[0] - middle[0], front[1] - middle[1]) || 1
  const share = HANDLE_DISTANCE / length
  const end: Point = [front[0] + share * (front[0] - middle[0]), front[1] + share * (front[1] - middle[1])]
  return [front, end]
}

/** The middle of a thing in the map [m]. */
export function middleOf({ x, y, yaw }: Placement, { ahead }: Extent): Point {
  return [x + ahead * Math.cos(yaw), y + ahead * Math.sin(yaw)]
}

/** Whether a place of the screen is on a thing, or nearer to it than `margin` [CSS pixels]. */
export function isHit(at: Point, pose: Pose, extent: Extent, project: Projection, margin: number): boolean {
  const corners = cornersOf(pose, extent, project)
  return corners !== null && isInside(at, hull(corners), margin)
}

/** A point in the axes of a thing [m], in those of the map. */
function inMap({ position, orientation }: Pose, x: number, y: number, z: number): [x: number, y: number, z: number] {
  const [w, i, j, k] = orientation
  // twice the cross product of the axis with the point
  const [a, b, c] = [2 * (j * z - k * y), 2 * (k * x - i * z), 2 * (i * y - j * x)]
  return [
    position[0] + x + w * a + j * c - k * b,
    position[1] + y + w * b + k * a - i * c,
    position[2] + z + w * c + i * b - j * a,
  ]
}

/** The convex hull (Andrew's monotone chain), in one direction of rotation. */
function hull(points: readonly Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1])
  const half = (ordered: readonly Point[]): Point[] => {
    const chain: Point[] = []
    for (const point of ordered) {
      while (chain.length > 1 && cross(chain[chain.length - 2], chain[chain.length - 1], point) <= 0) chain.pop()
      chain.push(point)
    }
    return chain.slice(0, -1)
  }
  return [...half(sorted), ...half(sorted.reverse())]
}

function cross(a: Point, b: Point, c: Point): number {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/** Whether a point is within `margin` of each edge of a hull, on its inner side. */
function isInside(at: Point, corners: readonly Point[], margin: number): boolean {
  return corners.every((a, i) => {
    const b = corners[(i + 1) % corners.length]
    return cross(a, b, at) >= -margin * Math.hypot(b[0] - a[0], b[1] - a[1])
  })
}

/** An element of a drawing. */
export function svg<Name extends keyof SVGElementTagNameMap>(
  name: Name,
  attributes: Record<string, string>,
): SVGElementTagNameMap[Name] {
  const element = document.createElementNS('http://www.w3.org/2000/svg', name)
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value)
  return element
}
