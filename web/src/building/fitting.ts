// Where pieces of a map go: poses of modules whose ports meet others, snapping, mirror images, outlines.
import type { Point, Projection } from '../editing/outline'
import type { MapModule, MapPart, MapPort, MapScene, ModuleScene } from '../messages'

/** A place and a heading in the map [m], [rad]. */
export interface Pose {
  x: number
  y: number
  yaw: number
}

/** A port of a placed module. */
export interface PortPlace extends Pose {
  part: string
  name: string
  width: number
  state: MapPort['state']
}

/** Largest difference of the widths of ports that fit, and largest distance of ports at the same place [m]. */
const SAME = 1e-3
/** Distance at which the pointer, and a port of the piece in hand, snap to a port [CSS pixels]. */
const REACH = { pointer: 36, port: 22 }
/** Distance of the places that are tried for a new piece [m], and how many circles of them. */
const GRID = 0.3
const RINGS = 60
/** How far from a thin part the pointer still hits it [m]. */
const SLACK = 0.06

/** A point in the axes of a pose, in the map. */
export function inMap({ x, y, yaw }: Pose, px: number, py: number): Point {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)]
  return [x + c * px - s * py, y + s * px + c * py]
}

/** A point of the map in the axes of a pose. */
export function inPose({ x, y, yaw }: Pose, [px, py]: Point): Point {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)]
  return [c * (px - x) + s * (py - y), -s * (px - x) + c * (py - y)]
}

/** The ports of all modules of the map. */
export function portsOf(scene: MapScene): PortPlace[] {
  return Object.entries(scene.ports).flatMap(([part, ports]) =>
    Object.entries(ports).map(([name, port]) => ({ part, name, ...port })),
  )
}

/** Ports at which a piece can be set, also those that may stay open. */
export function freePorts(scene: MapScene): PortPlace[] {
  return portsOf(scene).filter(({ state }) => state !== 'joined')
}

/** The port of a module that has that pose, in the map. */
export function portAt(pose: Pose, port: MapPort): Pose {
  const [x, y] = inMap(pose, port.x, port.y)
  return { x, y, yaw: wrapped(pose.yaw + port.yaw) }
}

/** The pose in which a port of a module meets another port, which faces it. */
export function meeting(port: MapPort, target: Pose): Pose {
  const yaw = wrapped(target.yaw + Math.PI - port.yaw)
  const [x, y] = inMap({ x: target.x, y: target.y, yaw }, -port.x, -port.y)
  return { x, y, yaw }
}

export function isSamePlace(a: Pose, b: Pose): boolean {
  return Math.hypot(a.x - b.x, a.y - b.y) < SAME
}

/** Names of the ports of a module that are as wide as another one. */
export function fittingPorts({ ports }: ModuleScene, width: number): string[] {
  return Object.keys(ports).filter((name) => Math.abs(ports[name].width - width) <= SAME)
}

/** The joints at which a module can be inserted: one of the two ports that are joined. */
export function jointsOf(scene: MapScene): PortPlace[] {
  const joined = portsOf(scene).filter(({ state }) => state === 'joined')
  return joined.filter((port, i) => !joined.slice(0, i).some((other) => isSamePlace(other, port)))
}

/** Modules that can replace a part, because they have its joined ports, and where they are then placed. */
export function replacements(scene: MapScene, name: string): { module: string; pose: Pose }[] {
  const part = scene.parts[name]
  const ports = Object.values(scene.ports[name] ?? {})
  const joined = ports.filter(({ state }) => state === 'joined')
  const kept = joined.length > 0 ? joined : ports
  const [first] = kept
  if (part?.type !== 'MapModule' || !first) return []
  return Object.entries(scene.modules).flatMap(([module, spec]) => {
    if (module === part.module) return []
    const poses = fittingPorts(spec, first.width).map((own) =>
      meeting(spec.ports[own], { ...first, yaw: first.yaw + Math.PI }),
    )
    const pose = poses.find((at) => kept.every((port) => hasPort(spec, at, port)))
    return pose ? [{ module, pose }] : []
  })
}

/** Whether a module at a pose has a port like another one, at its place. */
function hasPort(module: ModuleScene, pose: Pose, port: MapPort): boolean {
  return fittingPorts(module, port.width).some((name) => {
    const at = portAt(pose, module.ports[name])
    return isSamePlace(at, port) && Math.cos(at.yaw - port.yaw) > 1 - SAME
  })
}

/** Names of the modules that fit to a port. */
export function fittingModules(scene: MapScene, width: number): string[] {
  return Object.keys(scene.modules).filter((name) => fittingPorts(scene.modules[name], width).length > 0)
}

/** The port by which a module, joined there instead of by `port`, lies as its mirror image; null: there is none. */
export function mirrorPort(module: ModuleScene, port: string): string | null {
  const wanted = layoutAt(module, port).map(([x, y]): Point => [x, -y])
  const isSame = (name: string): boolean => {
    const there = layoutAt(module, name)
    return wanted.every(([x, y]) => there.some(([a, b]) => Math.hypot(a - x, b - y) < 1e-6))
  }
  const found = fittingPorts(module, module.ports[port].width).filter(isSame)
  return found.find((name) => name !== port) ?? found[0] ?? null
}

/** The middle of a module and its other ports, seen from a port. */
function layoutAt(module: ModuleScene, port: string): Point[] {
  const pose = meeting(module.ports[port], { x: 0, y: 0, yaw: 0 })
  const others = Object.entries(module.ports).filter(([name]) => name !== port)
  return [[pose.x, pose.y], ...others.map(([, { x, y }]) => inMap(pose, x, y))]
}

/** The pose in which a module in hand snaps to a port near the pointer, or near one of its ports; null: to none.
 *
 * `isPointerOnly`: only to a port near the pointer.
 */
export function snapped(
  module: ModuleScene,
  hand: { pose: Pose; port: string },
  targets: readonly PortPlace[],
  pointer: Point,
  project: Projection,
  isPointerOnly = false,
): { pose: Pose; port: string; target: PortPlace } | null {
  let best: { pose: Pose; port: string; target: PortPlace } | null = null
  let least = 1
  const own = Object.entries(module.ports).map(([name, port]) => {
    const at = portAt(hand.pose, port)
    return { name, port, shown: project(at.x, at.y, 0) }
  })
  for (const target of targets) {
    const shown = project(target.x, target.y, 0)
    const names = fittingPorts(module, target.width)
    if (!shown || names.length === 0) continue
    const port = names.includes(hand.port) ? hand.port : names[0]
    const nearPointer = distance(shown, pointer) / REACH.pointer
    if (nearPointer < least) {
      least = nearPointer
      best = { pose: meeting(module.ports[port], target), port, target }
    }
    for (const { name, port, shown: at } of isPointerOnly ? [] : own) {
      const near = at ? distance(shown, at) / REACH.port : 1
      if (!names.includes(name) || near >= least) continue
      least = near
      best = { pose: meeting(port, target), port: name, target }
    }
  }
  return best
}

/** Length and width of a module in hand or in the map [m]. */
export function sizeOf(part: Pick<MapModule, 'length' | 'width'>, module: ModuleScene): Point {
  return [part.length ?? module.length, part.width ?? module.width]
}

/** The corners of a rectangle around a pose, from its front left. */
export function corners(pose: Pose, [length, width]: Point): Point[] {
  return [
    [1, 1],
    [-1, 1],
    [-1, -1],
    [1, -1],
  ].map(([a, b]) => inMap(pose, (0.5 * a * length) as number, (0.5 * b * width) as number))
}

/** The line around a part in the map, or along it (a wall). */
export function outlineOf(part: MapPart, scene: MapScene): Point[] {
  switch (part.type) {
    case 'MapModule': {
      const module = scene.modules[part.module]
      return module ? corners(part, sizeOf(part, module)) : []
    }
    case 'MapBlock':
      return corners(part, [part.length, part.width])
    case 'MapProp':
      return corners(part, [0.08, 0.08])
    case 'MapWall':
      return part.points
  }
}

/** Name of the part at a point of the ground: the smallest one; empty: none. */
export function partAt(scene: MapScene, at: Point): string {
  let [found, least] = ['', Number.POSITIVE_INFINITY]
  for (const [name, part] of Object.entries(scene.parts)) {
    const line = outlineOf(part, scene)
    const isHit = part.type === 'MapWall' ? isNear(part, at) : line.length > 0 && isInside(line, at)
    const area = part.type === 'MapWall' || part.type === 'MapProp' ? 0 : Math.abs(areaOf(line))
    if (isHit && area < least) [found, least] = [name, area]
  }
  return found
}

/** The place nearest to `at` where a rectangle of that size touches no part but lawns; `at` if there is none near. */
export function freePlace(scene: MapScene, size: Point, [x, y]: Point): Point {
  const isLawn = (part: MapPart): boolean => part.type === 'MapModule' && scene.modules[part.module]?.type === 'terrain'
  const taken = Object.values(scene.parts).filter((part) => !isLawn(part))
  const boxes = taken.flatMap((part) => spans(part, scene).map(boundsOf))
  const [dx, dy] = [0.5 * size[0], 0.5 * size[1]]
  for (let ring = 0; ring < RINGS; ring++)
    for (let i = 0; i < Math.max(1, 8 * ring); i++) {
      const angle = (2 * Math.PI * i) / Math.max(1, 8 * ring)
      const at: Point = [x + ring * GRID * Math.cos(angle), y + ring * GRID * Math.sin(angle)]
      const isFree = boxes.every(
        ([x0, y0, x1, y1]) => at[0] + dx < x0 || at[0] - dx > x1 || at[1] + dy < y0 || at[1] - dy > y1,
      )
      if (isFree) return at
    }
  return [x, y]
}

/** The points around each piece of a part: a wall may enclose places that are free. */
function spans(part: MapPart, scene: MapScene): readonly (readonly Point[])[] {
  if (part.type !== 'MapWall') return [outlineOf(part, scene)]
  const ends = part.is_closed ? [...part.points.slice(1), ...part.points.slice(0, 1)] : part.points.slice(1)
  const half = 0.5 * part.thickness
  return ends.map(([x, y], i) => {
    const [fromX, fromY] = part.points[i] ?? [x, y]
    return [
      [Math.min(x, fromX) - half, Math.min(y, fromY) - half],
      [Math.max(x, fromX) + half, Math.max(y, fromY) + half],
    ]
  })
}

/** The least and the largest coordinates of points: x0, y0, x1, y1. */
function boundsOf(points: readonly Point[]): [number, number, number, number] {
  const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)]
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]
}

/** A part that is moved by dx, dy [m] and turned about its middle [rad]. */
export function movedPart(part: MapPart, dx: number, dy: number, turn = 0): MapPart {
  if (part.type === 'MapWall')
    return { ...part, points: part.points.map(([x, y]): [number, number] => [x + dx, y + dy]) }
  return { ...part, x: part.x + dx, y: part.y + dy, yaw: wrapped(part.yaw + turn) }
}

/** A part that is turned about a point of the map [rad]. */
export function turnedPart(part: MapPart, [x, y]: Point, turn: number): MapPart {
  const around = { x, y, yaw: turn }
  const turned = (point: Point): [number, number] => [...inMap(around, point[0] - x, point[1] - y)]
  if (part.type === 'MapWall') return { ...part, points: part.points.map(turned) }
  const [newX, newY] = turned([part.x, part.y])
  return { ...part, x: newX, y: newY, yaw: wrapped(part.yaw + turn) }
}

/** The middle of the outlines of parts. */
export function middleOf(parts: readonly MapPart[], scene: MapScene): Point {
  const points = parts.flatMap((part) => outlineOf(part, scene))
  const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)]
  return [0.5 * (Math.min(...xs) + Math.max(...xs)), 0.5 * (Math.min(...ys) + Math.max(...ys))]
}

/** The middle of an area that contains all points, and its width [m] for a camera that shows it from the south. */
export function areaAround(points: readonly Point[]): [x: number, y: number, width: number] | null {
  if (points.length === 0) return null
  const [x0, y0, x1, y1] = boundsOf(points)
  return [0.5 * (x0 + x1), 0.5 * (y0 + y1), Math.max(x1 - x0, 1.8 * (y1 - y0))]
}

/** Names of the modules that are joined with one, directly or not, and its own name. */
export function connectedParts(scene: MapScene, start: string): string[] {
  const joined = portsOf(scene).filter(({ state }) => state === 'joined')
  const found = [start]
  for (const name of found)
    for (const port of joined.filter(({ part }) => part === name))
      for (const other of joined)
        if (other.part !== name && isSamePlace(port, other) && !found.includes(other.part)) found.push(other.part)
  return found
}

/** How far a group of parts moves further so that one of its ends meets one of the others [m]; null: none is near. */
export function groupSnap(
  ends: readonly PortPlace[],
  [dx, dy]: Point,
  targets: readonly PortPlace[],
  project: Projection,
): Point | null {
  let [best, least]: [Point | null, number] = [null, REACH.port]
  for (const end of ends) {
    const shown = project(end.x + dx, end.y + dy, 0)
    for (const target of targets) {
      const there = project(target.x, target.y, 0)
      const isFacing = Math.abs(wrapped(end.yaw - target.yaw - Math.PI)) < 1e-2
      if (!shown || !there || !isFacing || Math.abs(end.width - target.width) > SAME) continue
      if (distance(shown, there) >= least) continue
      least = distance(shown, there)
      best = [target.x - end.x, target.y - end.y]
    }
  }
  return best
}

/** An angle between -pi and pi [rad]. */
export function wrapped(angle: number): number {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI))
}

/** CSS transform that shows a rectangle of that size [CSS pixels] with its corners at four points of the screen. */
export function transformTo(width: number, height: number, [p0, p1, p2, p3]: readonly Point[]): string {
  const [dx1, dx2, dx3] = [p1[0] - p2[0], p3[0] - p2[0], p0[0] - p1[0] + p2[0] - p3[0]]
  const [dy1, dy2, dy3] = [p1[1] - p2[1], p3[1] - p2[1], p0[1] - p1[1] + p2[1] - p3[1]]
  const det = dx1 * dy2 - dx2 * dy1
  const g = (dx3 * dy2 - dx2 * dy3) / det
  const h = (dx1 * dy3 - dx3 * dy1) / det
  const across = [p1[0] - p0[0] + g * p1[0], p1[1] - p0[1] + g * p1[1], 0, g].map((value) => value / width)
  const down = [p3[0] - p0[0] + h * p3[0], p3[1] - p0[1] + h * p3[1], 0, h].map((value) => value / height)
  return `matrix3d(${[...across, ...down, 0, 0, 1, 0, p0[0], p0[1], 0, 1].join()})`
}

function distance(a: Point, b: Point): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1])
}

function areaOf(line: readonly Point[]): number {
  return line.reduce((sum, [x, y], i) => {
    const [a, b] = line[(i + 1) % line.length]
    return sum + 0.5 * (x * b - a * y)
  }, 0)
}

/** Whether a point is in a convex polygon. */
function isInside(line: readonly Point[], [x, y]: Point): boolean {
  const sides = line.map(([ax, ay], i) => {
    const [bx, by] = line[(i + 1) % line.length]
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)
  })
  return sides.every((side) => side >= 0) || sides.every((side) => side <= 0)
}

function isNear({ points, thickness, is_closed }: MapPart & { type: 'MapWall' }, at: Point): boolean {
  const line = is_closed ? [...points, points[0]] : points
  return line.slice(1).some((end, i) => {
    const [start, dx, dy] = [line[i], end[0] - line[i][0], end[1] - line[i][1]]
    const share = ((at[0] - start[0]) * dx + (at[1] - start[1]) * dy) / (dx * dx + dy * dy || 1)
    const t = Math.max(0, Math.min(1, share))
    return distance(at, [start[0] + t * dx, start[1] + t * dy]) <= 0.5 * thickness + SLACK
  })
}
