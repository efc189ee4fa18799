// A vehicle to be drawn: its bones, its lamps and its surfaces in two details, all moved by one set of matrices.
import { BufferGeometry, Group, Matrix4, Mesh, ShaderMaterial, Vector3 } from 'three'
import type { IUniform, Object3D } from 'three'

import { outline, pieces } from './geometry'
import type { Asset } from './glb'
import { type Burning, type Lamp, lampLevels, LAMPS } from './lamps'
import type { VehicleMotion } from './motion'
import type { Profile } from './quality'
import { BONES, Rig, type Signals } from './rig'
import { depthMaterial } from './shadows'

const WHEELS = ['front_left', 'front_right', 'rear_left', 'rear_right']
/** A lamp reaches its brightness in about this time [s]. */
const SWITCHING = 0.025

export class VehicleModel {
  /** The vehicle frame in the map. */
  readonly root = new Matrix4()
  /** What is drawn into shadow maps. */
  caster: Object3D = new Group()
  /** How far it reaches from its origin [m]. */
  readonly reach: number
  /** Middle of it in its own axes, and half its length and width as they shade the ground [m]. */
  readonly middle = new Vector3()
  readonly half = new Vector3()
  /** How brightly each of `LAMPS` burns. */
  readonly levels = new Float32Array(LAMPS.length)
  private readonly wanted = new Float32Array(LAMPS.length)
  private readonly rig: Rig
  private readonly uniforms = {
    bone_poses: { value: new Float32Array(16 * BONES) },
    glows: { value: new Float32Array(1 + LAMPS.length) },
  }
  private readonly signals: Signals = {}
  private full: Mesh[] = []
  private reduced: Mesh[] = []
  private readonly rubbish: { dispose(): void }[] = []

  constructor(
    private readonly asset: Asset,
    readonly lamps: readonly Lamp[],
  ) {
    this.rig = new Rig(asset.nodes)
    this.uniforms.glows.value[0] = 1
    this.reach = this.measure()
  }

  /** What is drawn, made for that profile. */
  build(profile: Profile, material: (bones: Record<string, IUniform>) => ShaderMaterial): Group {
    const group = new Group()
    const own = material(this.uniforms)
    const meshes = (detail: 'full' | 'reduced'): Mesh[] =>
      pieces(this.asset, this.rig, detail, true).map(({ geometry }) => this.mesh(geometry, own))
    if (profile.fullDetail > 0) this.full = meshes('full')
    if (profile.fullDetail < Infinity) this.reduced = meshes('reduced')
    const all = [...this.full, ...this.reduced]
    if (all.length > 0) group.add(...all)
    // the proxy is enough for a plain shadow; a soft and fine one shows what the car is made of
    const shade = outline(this.asset, this.rig, profile.softness > 1 ? 'reduced' : 'shadow')
    const depth = depthMaterial(this.uniforms.bone_poses)
    this.rubbish.push(depth)
    if (shade) this.caster = this.mesh(shade, depth)
    return group
  }

  /** Puts it where it is at this moment, `dt` [s] after the last. */
  update(motion: VehicleMotion, dt: number, isNear: boolean): void {
    this.root.compose(motion.position, motion.orientation, ONE)
    const { signals } = this
    signals.steering = 0.5 * (motion.steering[0] + motion.steering[1])
    WHEELS.forEach((wheel, i) => {
      signals[`steering_${wheel}`] = motion.steering[i]
      signals[`spin_${wheel}`] = motion.spin[i]
      signals[`compression_${wheel}`] = motion.compression[i]
    })
    this.rig.pose(this.root, signals, this.uniforms.bone_poses.value)
    lampLevels(motion.frame.lights, this.wanted)
    const share = -Math.expm1(-dt / SWITCHING)
    this.levels.forEach((level, i) => {
      const next = level + share * (this.wanted[i] - level)
      this.levels[i] = Math.abs(next - this.wanted[i]) < 0.01 ? this.wanted[i] : next
    })
    this.uniforms.glows.value.set(this.levels, 1)
    const isFull = this.reduced.length === 0 || (isNear && this.full.length > 0)
    for (const mesh of this.full) mesh.visible = isFull
    for (const mesh of this.reduced) mesh.visible = !isFull
  }

  /** Adds the lamps that burn: those that throw far, or the others. */
  light(burning: Burning, isFar: boolean): void {
    this.lamps.forEach((lamp, i) => {
      if (lamp.isHeadlight === isFar && this.levels[i] > 0) burning.add(lamp, this.root, this.levels[i])
    })
  }

  distanceTo(eye: Vector3): number {
    return point.setFromMatrixPosition(this.root).distanceTo(eye)
  }

  /** x, y of its middle, cosine and sine of its yaw. */
  footprint(into: Float32Array, at: number): void {
    const e = this.root.elements
    const level = Math.max(Math.hypot(e[0], e[1]), 1e-6)
    point.copy(this.middle).applyMatrix4(this.root)
    into.set([point.x, point.y, e[0] / level, e[1] / level], at)
  }

  dispose(): void {
    for (const thing of this.rubbish) thing.dispose()
  }

  private mesh(geometry: BufferGeometry, material: ShaderMaterial): Mesh {
    const mesh = new Mesh(geometry, material)
    mesh.frustumCulled = false // its bones carry it elsewhere
    this.rubbish.push(geometry)
    return mesh
  }

  /** Size of what casts its shadow, at rest; how far that reaches. */
  private measure(): number {
    const shade = outline(this.asset, this.rig, 'shadow') ?? outline(this.asset, this.rig, 'full')
    if (!shade) return 0
    const poses = new Float32Array(16 * BONES)
    this.rig.pose(new Matrix4(), {}, poses)
    const [positions, bones] = [shade.getAttribute('position'), shade.getAttribute('bones')]
    const low = new Vector3(Infinity, Infinity, Infinity)
    const high = low.clone().negate()
    let reach = 0
    for (let i = 0; i < positions.count; i++) {
      pose.fromArray(poses, 16 * bones.getX(i))
      point.fromBufferAttribute(positions, i).applyMatrix4(pose)
      low.min(point)
      high.max(point)
      reach = Math.max(reach, point.length())
    }
    this.middle.addVectors(low, high).multiplyScalar(0.5)
    this.half.subVectors(high, low).multiplyScalar(0.5 * 0.92)
    return reach
  }
}

const ONE = new Vector3(1, 1, 1)
const point = new Vector3()
const pose = new Matrix4()
