// A vehicle in the scene: bones, lamps and meshes in two levels of detail.

import type { IUniform, Object3D } from 'three'
import { type BufferGeometry, Group, Matrix4, Mesh, type ShaderMaterial, Vector3 } from 'three'

import { meshParts, shadowGeometry } from './geometry'
import type { Asset, Vector } from './glb'
import { type ActiveLamps, LAMPS, type Lamp, lampBrightness } from './lamps'
import type { VehicleMotion } from './motion'
import type { Profile } from './quality'
import { depthMaterial } from './shadows'
import { BONES, type JointValues, Skeleton } from './skeleton'

const WHEELS = ['front_left', 'front_right', 'rear_left', 'rear_right']
/** Time constant of a lamp [s]. */
const SWITCH_TIME = 0.025

export class VehicleModel {
  /** Transform from the vehicle frame to the map. */
  readonly root = new Matrix4()
  /** The mesh for shadow maps. */
  caster: Object3D = new Group()
  /** Radius of the vehicle about its origin [m]. */
  readonly reach: number
  /** Centre in the vehicle frame, and half extents of the area of ambient occlusion [m]. */
  readonly middle = new Vector3()
  readonly half = new Vector3()
  /** Brightness of each of `LAMPS`, 0 to 1. */
  readonly levels = new Float32Array(LAMPS.length)
  private readonly wanted = new Float32Array(LAMPS.length)
  private readonly skeleton: Skeleton
  private readonly uniforms = {
    bone_poses: { value: new Float32Array(16 * BONES) },
    glows: { value: new Float32Array(1 + LAMPS.length) },
  }
  private readonly jointValues: JointValues = {}
  private full: Mesh[] = []
  private reduced: Mesh[] = []
  private readonly disposables: { dispose(): void }[] = []

  constructor(
    private readonly asset: Asset,
    readonly lamps: readonly Lamp[],
    private readonly paint: Vector | null,
  ) {
    this.skeleton = new Skeleton(asset.nodes)
    this.uniforms.glows.value[0] = 1
    this.reach = this.measure()
  }

  /** Builds the meshes for a profile. */
  build(profile: Profile, material: (bones: Record<string, IUniform>) => ShaderMaterial): Group {
    const group = new Group()
    const own = material(this.uniforms)
    const meshes = (detail: 'full' | 'reduced'): Mesh[] =>
      meshParts(this.asset, this.skeleton, detail, true, this.paint).map(({ geometry }) => this.mesh(geometry, own))
    if (profile.fullDetail > 0) this.full = meshes('full')
    if (profile.fullDetail < Infinity) this.reduced = meshes('reduced')
    const all = [...this.full, ...this.reduced]
    if (all.length > 0) group.add(...all)
    // a hard shadow needs only the simplified mesh; a soft one shows more detail
    const shadow = shadowGeometry(this.asset, this.skeleton, profile.softness > 1 ? 'reduced' : 'shadow')
    const depth = depthMaterial(this.uniforms.bone_poses)
    this.disposables.push(depth)
    if (shadow) this.caster = this.mesh(shadow, depth)
    return group
  }

  /** Updates pose, joints and lamps, `dt` [s] after the last update. */
  update(motion: VehicleMotion, dt: number, isNear: boolean): void {
    this.root.compose(motion.position, motion.orientation, ONE)
    const { jointValues } = this
    jointValues.steering = 0.5 * (motion.steering[0] + motion.steering[1])
    WHEELS.forEach((wheel, i) => {
      jointValues[`steering_${wheel}`] = motion.steering[i]
      jointValues[`spin_${wheel}`] = motion.spin[i]
      jointValues[`compression_${wheel}`] = motion.compression[i]
    })
    this.skeleton.pose(this.root, jointValues, this.uniforms.bone_poses.value)
    lampBrightness(motion.frame.lights, this.wanted)
    const share = -Math.expm1(-dt / SWITCH_TIME)
    this.levels.forEach((level, i) => {
      const next = level + share * (this.wanted[i] - level)
      this.levels[i] = Math.abs(next - this.wanted[i]) < 0.01 ? this.wanted[i] : next
    })
    this.uniforms.glows.value.set(this.levels, 1)
    const isFull = this.reduced.length === 0 || (isNear && this.full.length > 0)
    for (const mesh of this.full) mesh.visible = isFull
    for (const mesh of this.reduced) mesh.visible = !isFull
  }

  /** Adds the lamps that are on: the headlights if `isFar`, else the others. */
  light(activeLamps: ActiveLamps, isFar: boolean): void {
    this.lamps.forEach((lamp, i) => {
      if (lamp.isHeadlight === isFar && this.levels[i] > 0) activeLamps.add(lamp, this.root, this.levels[i])
    })
  }

  distanceTo(eye: Vector3): number {
    return point.setFromMatrixPosition(this.root).distanceTo(eye)
  }

  /** Writes x, y of the centre, cosine and sine of the yaw, and behind the tile in `tiles` half length and width. */
  footprint(places: Float32Array, tiles: Float32Array, at: number): void {
    const e = this.root.elements
    const level = Math.max(Math.hypot(e[0], e[1]), 1e-6)
    point.copy(this.middle).applyMatrix4(this.root)
    places.set([point.x, point.y, e[0] / level, e[1] / level], at)
    tiles.set([this.half.x, this.half.y], at + 2)
  }

  dispose(): void {
    for (const thing of this.disposables) thing.dispose()
  }

  private mesh(geometry: BufferGeometry, material: ShaderMaterial): Mesh {
    const mesh = new Mesh(geometry, material)
    mesh.frustumCulled = false // its bounding sphere does not follow the bones
    this.disposables.push(geometry)
    return mesh
  }

  /** Computes centre and half extents from the shadow mesh at rest; returns its radius [m]. */
  private measure(): number {
    const shadow =
      shadowGeometry(this.asset, this.skeleton, 'shadow') ?? shadowGeometry(this.asset, this.skeleton, 'full')
    if (!shadow) return 0
    const poses = new Float32Array(16 * BONES)
    this.skeleton.pose(new Matrix4(), {}, poses)
    const [positions, bones] = [shadow.getAttribute('position'), shadow.getAttribute('bones')]
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
