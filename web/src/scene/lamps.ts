// Lamps of vehicles as uniforms for the shaders. The formulas are those of render/lighting.py.
import { Matrix4, Vector3 } from 'three'
import type { Lights, VehicleScene } from '../messages'
import { Headlights, TailLights } from '../messages'

const KINDS = ['head', 'high_beam', 'front_indicator', 'rear_indicator', 'tail', 'reverse']

/** The lamps of a vehicle, in the order of `actuators.lights.LAMPS`. */
export const LAMPS = KINDS.flatMap((kind) => [`${kind}_left`, `${kind}_right`])

/** The first ones are headlights. */
const HEADLIGHTS = 4

/** Number of lamps in the shaders (WebGL guarantees 224 uniforms), and of headlights with shadows, which come first. */
export const LAMP_SLOTS = 32
export const BEAM_SLOTS = 4

/** `Beam` of render/look.py. */
interface Beam {
  intensity: number
  inner: number
  outer: number
  pitch: number
  is_forward: boolean
  cutoff: number
}

/** A lamp at full brightness, in the vehicle frame. */
export interface Lamp {
  position: Vector3
  aim: Vector3
  up: Vector3
  color: Vector3
  range: number
  cosOuter: number
  sharpness: number
  cutoff: number
  isHeadlight: boolean
}

/** The lamps of a vehicle, in the order of `LAMPS`. */
export function lampsOf(vehicle: VehicleScene, beams: Record<string, Beam>): Lamp[] {
  return LAMPS.map((name, i) => {
    const own = vehicle.lamps[name]
    const beam = beams[name.slice(0, name.lastIndexOf('_'))]
    const ahead = beam.is_forward ? 1 : -1
    const c = Math.cos(beam.pitch)
    const s = Math.sin(beam.pitch)
    return {
      position: new Vector3(...own.position).add(new Vector3(0.006 * ahead, 0, 0)),
      aim: new Vector3(ahead * c, 0, -s),
      up: new Vector3(ahead * s, 0, c),
      color: new Vector3(...own.color).multiplyScalar(beam.intensity),
      range: own.range,
      cosOuter: Math.cos(beam.outer),
      sharpness: 1 / (Math.cos(beam.inner) - Math.cos(beam.outer)),
      cutoff: beam.cutoff,
      isHeadlight: i < HEADLIGHTS,
    }
  })
}

/** Writes the brightness of each of `LAMPS`, 0 to 1. */
export function lampBrightness(lights: Lights, into: Float32Array): void {
  const low = lights.headlights === Headlights.OFF ? 0 : 1
  const high = lights.headlights === Headlights.HIGH ? 1 : 0
  const left = lights.left_indicator ? 1 : 0
  const right = lights.right_indicator ? 1 : 0
  const tail = lights.tail_lights / TailLights.BRIGHT
  const reverse = lights.reverse_lights ? 1 : 0
  into.set([low, low, high, high, left, right, left, right, tail, tail, reverse, reverse])
}

/** The lamps that are on, in the map frame, as arrays for the shaders. */
export class ActiveLamps {
  readonly position = new Float32Array(4 * LAMP_SLOTS) // position, range
  readonly aim = new Float32Array(4 * LAMP_SLOTS) // direction, cosine of the outer cone
  readonly color = new Float32Array(4 * LAMP_SLOTS) // intensity [cd], sharpness of the cone
  readonly up = new Float32Array(4 * LAMP_SLOTS) // up, and the sharpness of the cutoff above the beam (0: no cutoff)
  /** Number of headlights with shadows, of all headlights and of all lamps; each group is at the start of the arrays. */
  beams = 0
  heads = 0
  lamps = 0

  clear(): void {
    this.beams = this.heads = this.lamps = 0
  }

  /** Adds a lamp: first the headlights with shadows, then other headlights, then the rest. False if all slots are used. */
  add(lamp: Lamp, root: Matrix4, level: number): boolean {
    if (this.lamps === LAMP_SLOTS) return false
    const slot = 4 * this.lamps++
    if (lamp.isHeadlight) this.heads = this.lamps
    point.copy(lamp.position).applyMatrix4(root).toArray(this.position, slot)
    this.position[slot + 3] = lamp.range
    point.copy(lamp.aim).transformDirection(root).toArray(this.aim, slot)
    this.aim[slot + 3] = lamp.cosOuter
    point.copy(lamp.color).multiplyScalar(level).toArray(this.color, slot)
    this.color[slot + 3] = lamp.sharpness
    point.copy(lamp.up).transformDirection(root).toArray(this.up, slot)
    this.up[slot + 3] = lamp.cutoff
    return true
  }

  /** Writes the transform from the map frame to the clip space of the shadow map of a headlight. */
  matrix(slot: number, into: Matrix4): Matrix4 {
    const cos = this.aim[4 * slot + 3]
    const tangent = (1.05 * Math.sqrt(1 - cos * cos)) / cos
    const near = 0.03
    const far = this.position[4 * slot + 3]
    aim.fromArray(this.aim, 4 * slot)
    up.fromArray(this.up, 4 * slot)
    side.crossVectors(up, aim)
    point.fromArray(this.position, 4 * slot)
    const [x, y, z] = [-side.dot(point), -up.dot(point), -aim.dot(point)]
    look.set(side.x, side.y, side.z, x, up.x, up.y, up.z, y, aim.x, aim.y, aim.z, z, 0, 0, 0, 1)
    const depth = (far + near) / (far - near)
    const shift = (-2 * far * near) / (far - near)
    into.set(1 / tangent, 0, 0, 0, 0, 1 / tangent, 0, 0, 0, 0, depth, shift, 0, 0, 1, 0)
    return into.multiply(look)
  }
}

const point = new Vector3()
const aim = new Vector3()
const up = new Vector3()
const side = new Vector3()
const look = new Matrix4()
