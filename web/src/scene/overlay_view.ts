// Overlays of the scene: collision shapes, contact forces as arrows, and the axes of vehicles and sensors.
import { type Camera, Group, Matrix4, Quaternion, Vector3 } from 'three'

import type { CollisionShapes, ContactForces, Pose, Shapes } from '../messages'
import type { Store } from '../store'
import { type PlacedObject, quaternion, type WorldState } from './motion'
import { ARROW, OVERLAY_COLOURS, OVERLAY_SIZES } from './overlay_look'
import { letters, line, type Place, type Primitive, Strokes, type Tint } from './strokes'

const [SPHERE, CYLINDER] = [2, 5]
/** Width of lines [m]: at least two pixels. Lines of a circle, and of the side of a cylinder. */
const { width: WIDTH, around: AROUND, sides: SIDES } = OVERLAY_SIZES
/** Fixed shapes are shown within that distance of the vehicle [m], and chosen again when it has moved so far [m]. */
const { near: NEAR } = OVERLAY_SIZES
const MOVED = 0.5
/** The longest arrow, length of the axes of a vehicle and of a sensor, height of the letters [m]. */
const { longest: LONGEST, axis: AXIS, sensor_axis: SENSOR_AXIS, letter: LETTER } = OVERLAY_SIZES
/** A force on the body of a vehicle is shown so long [ms]: a collision lasts a few milliseconds. */
const LINGER = 1000 * OVERLAY_SIZES.linger
const WHEEL = /^(front|rear)_(left|right)$/

/** What is drawn in the frame of a vehicle or an object. */
interface OfBody {
  shapes?: Strokes
  axes?: Strokes
  forces?: Strokes
}

export class OverlayView {
  readonly group = new Group()
  private readonly bodies = new Map<string, OfBody>()
  private readonly fixed = new Strokes()
  private shapes: Shapes | null = null
  private contacts: Record<string, ContactForces> | null = null
  private readonly bumps = new Map<string, { until: number; arrow: Primitive[] }>()
  private readonly chosenAt = new Vector3(Number.NaN)

  constructor() {
    this.group.add(this.fixed.mesh)
  }

  /** Shows what the store has, at the poses of the state. `followed`: the vehicle near which fixed shapes are shown. */
  update(store: Store, state: WorldState, followed: PlacedObject, camera: Camera): void {
    const { areShapesShown, areForcesShown, areAxesShown } = store
    const isAny = areShapesShown.value || areForcesShown.value || areAxesShown.value
    this.group.visible = isAny
    if (!isAny) return
    if (this.shapes !== store.shapes.value) this.build(store.shapes.value)
    if (areForcesShown.value) this.showForces(store)
    this.fixed.mesh.visible = areShapesShown.value && this.shapes !== null
    if (this.fixed.mesh.visible) this.showFixed(followed.position)
    for (const [name, { shapes, axes, forces }] of this.bodies) {
      const placed = state.vehicles.get(name) ?? state.objects.get(name)
      for (const [strokes, isShown] of [
        [shapes, areShapesShown.value],
        [axes, areAxesShown.value],
        [forces, areForcesShown.value],
      ] as const) {
        if (!strokes) continue
        strokes.mesh.visible = isShown && strokes.count > 0 && placed !== undefined
        if (!strokes.mesh.visible || !placed) continue
        strokes.mesh.position.copy(placed.position)
        strokes.mesh.quaternion.copy(placed.orientation)
        strokes.spread(camera)
      }
    }
  }

  dispose(): void {
    this.clear()
    this.fixed.dispose()
  }

  private clear(): void {
    for (const of of this.bodies.values())
      for (const strokes of Object.values(of) as Strokes[]) {
        this.group.remove(strokes.mesh)
        strokes.dispose()
      }
    this.bodies.clear()
    this.bumps.clear()
    this.contacts = null
  }

  private strokes(name: string, kind: keyof OfBody): Strokes {
    const of = this.bodies.get(name) ?? {}
    this.bodies.set(name, of)
    let strokes = of[kind]
    if (!strokes) {
      strokes = of[kind] = new Strokes(true)
      this.group.add(strokes.mesh)
    }
    return strokes
  }

  private build(shapes: Shapes | null): void {
    this.clear()
    this.shapes = shapes
    this.chosenAt.set(Number.NaN, 0, 0)
    if (!shapes) return
    for (const [name, of] of Object.entries(shapes.bodies)) {
      const tint = name in shapes.sensors ? OVERLAY_COLOURS.vehicle : OVERLAY_COLOURS.object
      this.strokes(name, 'shapes').fill(outlines(of, tint, () => true))
    }
    for (const [name, sensors] of Object.entries(shapes.sensors)) {
      const own = { position: [0, 0, 0], orientation: [1, 0, 0, 0] } as unknown as Pose
      const all = axesOf(own, AXIS, name)
      for (const [sensor, pose] of Object.entries(sensors)) all.push(...axesOf(pose, SENSOR_AXIS, sensor))
      this.strokes(name, 'axes').fill(all)
    }
  }

  private showFixed(near: Vector3): void {
    const { fixed } = this.shapes ?? {}
    if (!fixed || this.chosenAt.distanceTo(near) < MOVED) return
    this.chosenAt.copy(near)
    const isNear = (i: number) => {
      at.fromArray(fixed.position, 3 * i).sub(near)
      half.fromArray(fixed.size, 3 * i)
      return at.length() - half.length() < NEAR
    }
    this.fixed.fill(outlines(fixed, OVERLAY_COLOURS.fixed, isNear))
  }

  private showForces(store: Store): void {
    const now = performance.now()
    const isNew = this.contacts !== store.contacts.value
    const isOver = [...this.bumps.values()].some(({ until }) => until < now)
    if (!isNew && !isOver) return
    this.contacts = store.contacts.value
    for (const [key, { until }] of this.bumps) if (until < now) this.bumps.delete(key)
    for (const [name, { parts, position, force }] of Object.entries(this.contacts)) {
      if (!store.forceScale.value) continue
      const all: Primitive[] = []
      for (const [i, part] of parts.entries()) {
        const [from, by] = [position, force].map((of) => [...of.subarray(3 * i, 3 * i + 3)])
        if (WHEEL.test(part)) all.push(...arrow(from, by, store.forceScale.value, OVERLAY_COLOURS.wheel))
        else {
          const drawn = [...arrow(from, by, store.forceScale.value, OVERLAY_COLOURS.body), ...amount(from, by)]
          this.bumps.set(`${name}\n${part}`, { until: now + LINGER, arrow: drawn })
        }
      }
      for (const [key, bump] of this.bumps) if (key.startsWith(`${name}\n`)) all.push(...bump.arrow)
      this.strokes(name, 'forces').fill(all)
    }
  }
}

/** An arrow from a point along a force [N]; `scale`: the force of an arrow of the length `ARROW` [N]. */
export function arrow(from: Place, force: Place, scale: number, tint: Tint): Primitive[] {
  along.fromArray([...force])
  const size = along.length()
  if (size === 0) return []
  along.divideScalar(size)
  const length = Math.min((size / scale) * ARROW, LONGEST)
  const head = Math.min(0.3 * length, 0.02)
  const tip = new Vector3().fromArray([...from]).addScaledVector(along, length)
  aside.set(0, 0, 1).cross(along)
  if (aside.lengthSq() < 1e-6) aside.set(0, 1, 0)
  aside.normalize()
  const lines = [line(from, tip.toArray(), tint, 2 * WIDTH)]
  for (let k = 0; k < 4; k++) {
    at.copy(aside).applyAxisAngle(along, (k * Math.PI) / 2)
    const end = tip
      .clone()
      .addScaledVector(along, -head)
      .addScaledVector(at, 0.5 * head)
    lines.push(line(tip.toArray(), end.toArray(), tint, 2 * WIDTH))
  }
  return lines
}

/** The size of a force [N] in digits, above its point. */
function amount(from: Place, force: Place): Primitive[] {
  const size = Number(Math.hypot(...force).toPrecision(2))
  return letters(`${size} N`, [from[0], from[1], from[2] + 2 * LETTER], OVERLAY_COLOURS.body, LETTER)
}

function axesOf(pose: Pose, length: number, name: string): Primitive[] {
  quaternion(pose, turn)
  const from = [...pose.position]
  const all = OVERLAY_COLOURS.axes.map((tint, k) => {
    along
      .setComponent(k, length)
      .setComponent((k + 1) % 3, 0)
      .setComponent((k + 2) % 3, 0)
    const to = along.applyQuaternion(turn).add(at.fromArray(from)).toArray()
    return line(from, to, tint, WIDTH)
  })
  return [...all, ...letters(name, [from[0], from[1], from[2] + 1.1 * length + LETTER], OVERLAY_COLOURS.name, LETTER)]
}

/** The edges of the chosen shapes. */
export function outlines(shapes: CollisionShapes, tint: Tint, isChosen: (i: number) => boolean): Primitive[] {
  const all: Primitive[] = []
  for (const [i, kind] of [...shapes.kind].entries()) {
    if (!isChosen(i)) continue
    const [a, b, c, d, e, f, g, h, k] = shapes.rotation.subarray(9 * i, 9 * i + 9)
    const [x, y, z] = shapes.position.subarray(3 * i, 3 * i + 3)
    placed.set(a, b, c, x, d, e, f, y, g, h, k, z, 0, 0, 0, 1)
    const put = (...point: [number, number, number]) =>
      at
        .set(...point)
        .applyMatrix4(placed)
        .toArray()
    for (const [from, to] of edges(Number(kind), shapes.size.subarray(3 * i, 3 * i + 3)))
      all.push(line(put(...from), put(...to), tint, WIDTH))
  }
  return all
}

type Point = [x: number, y: number, z: number]

/** The lines that show a shape, in its own axes; `size` as in `CollisionShapes`. */
function edges(kind: number, [a, b, c]: Float64Array): [Point, Point][] {
  if (kind === SPHERE)
    return [
      circle((u, v) => [a * u, a * v, 0]),
      circle((u, v) => [a * u, 0, a * v]),
      circle((u, v) => [0, a * u, a * v]),
    ].flat()
  if (kind === CYLINDER) {
    const sides = [...Array(SIDES).keys()].map((k) => (2 * Math.PI * k) / SIDES)
    return [
      ...circle((u, v) => [a * u, a * v, -b]),
      ...circle((u, v) => [a * u, a * v, b]),
      ...sides.map((angle): [Point, Point] => {
        const [x, y] = [a * Math.cos(angle), a * Math.sin(angle)]
        return [
          [x, y, -b],
          [x, y, b],
        ]
      }),
    ]
  }
  const all: [Point, Point][] = []
  for (const s of [-1, 1])
    for (const t of [-1, 1])
      all.push(
        [
          [-a, s * b, t * c],
          [a, s * b, t * c],
        ],
        [
          [s * a, -b, t * c],
          [s * a, b, t * c],
        ],
        [
          [s * a, t * b, -c],
          [s * a, t * b, c],
        ],
      )
  return all
}

function circle(point: (u: number, v: number) => Point): [Point, Point][] {
  const at = (k: number) => point(Math.cos((2 * Math.PI * k) / AROUND), Math.sin((2 * Math.PI * k) / AROUND))
  return [...Array(AROUND).keys()].map((k) => [at(k), at(k + 1)])
}

const placed = new Matrix4()
const at = new Vector3()
const half = new Vector3()
const along = new Vector3()
const aside = new Vector3()
const turn = new Quaternion()
