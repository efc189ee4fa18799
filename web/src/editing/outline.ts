// Outlines of vehicles and objects on the screen: what the pointer hits, and what the overlay draws.
import type { Scene } from '../messages'
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
}

/** The extent of a vehicle or an object of the Scene; null if it is not known. */
export function extentOf(scene: Scene | null, name: string): Extent | null {
  const vehicle = scene?.vehicles[name]
  if (vehicle) return { ahead: 0.5 * vehicle.wheelbase, size: vehicle.size }
  const size = scene?.object_sizes[name]
  return size ? { ahead: 0, size } : null
}

/** The corners of the base on the screen, counterclockwise from the front left; null if one is behind the camera. */
export function baseOf(placed: Placement, extent: Extent, project: Projection, z = 0): Point[] | null {
  const corners = CORNERS.map(([x, y]) => {
    const at = inMap(placed, extent.ahead + 0.5 * x * extent.size[0], 0.5 * y * extent.size[1])
    return project(at[0], at[1], z)
  })
  return corners.every((corner) => corner !== null) ? corners : null
}

const CORNERS = [
  [1, 1],
  [-1, 1],
  [-1, -1],
  [1, -1],
] as const

/** Where the line to the handle starts and ends on the screen; the end is the handle. */
export function handleOf(placed: Placement, extent: Extent, project: Projection): readonly [Point, Point] | null {
  const middle = project(...inMap(placed, extent.ahead, 0), 0)
  const front = project(...inMap(placed, extent.ahead + 0.5 * extent.size[0], 0), 0)
  if (!middle || !front) return null
  const length = Math.hypot(front[0] - middle[0], front[1] - middle[1]) || 1
  const share = HANDLE_DISTANCE / length
  const end: Point = [front[0] + share * (front[0] - middle[0]), front[1] + share * (front[1] - middle[1])]
  return [front, end]
}

/** The middle of a thing in the map [m]. */
export function middleOf(placed: Placement, extent: Extent): Point {
  return inMap(placed, extent.ahead, 0)
}

/** Whether a place of the screen is on a thing, or nearer to it than `margin` [CSS pixels]. */
export function isHit(at: Point, placed: Placement, extent: Extent, project: Projection, margin: number): boolean {
  const low = baseOf(placed, extent, project)
  const high = baseOf(placed, extent, project, extent.size[2])
  return low !== null && high !== null && isInside(at, hull([...low, ...high]), margin)
}

function inMap({ x, y, yaw }: Placement, ahead: number, left: number): Point {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)]
  return [x + c * ahead - s * left, y + s * ahead + c * left]
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
