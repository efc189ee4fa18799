// The bones of an asset: its moving nodes, each relative to its parent. Bone 0 is the root of the asset.
import { Matrix4, Quaternion, Vector3 } from 'three'

import type { Joint, Node } from './glb'

/** Maximum number of bones of a vehicle. */
export const BONES = 24

/** Joint values by signal name: 'steering', 'spin_front_left', 'compression_rear_right' ... */
export type JointValues = Record<string, number>

interface Bone {
  parent: number
  joint: Joint
  /** Rest pose in the frame of the parent. */
  place: Matrix4
}

export class Skeleton {
  /** For each node: its bone, and its rest pose in the frame of that bone. */
  readonly boneOf: number[] = []
  readonly restPoseOf: Matrix4[] = []
  private readonly bones: Bone[] = []
  private readonly poses: Matrix4[] = [new Matrix4()]

  constructor(nodes: readonly Node[]) {
    const one = new Vector3(1, 1, 1)
    for (const node of nodes) {
      const own = new Matrix4().compose(new Vector3(...node.position), new Quaternion(...node.orientation), one)
      let place = node.parent < 0 ? own : own.premultiply(this.restPoseOf[node.parent])
      let bone = node.parent < 0 ? 0 : this.boneOf[node.parent]
      if (node.joint) {
        this.bones.push({ parent: bone, joint: node.joint, place })
        this.poses.push(new Matrix4())
        bone = this.bones.length
        place = new Matrix4()
      }
      this.boneOf.push(bone)
      this.restPoseOf.push(place)
    }
    if (this.poses.length > BONES) throw new Error(`the asset has ${this.poses.length} bones; the maximum is ${BONES}`)
  }

  /** Writes the transform from each bone to the map (column-major) for an asset at `root` with these joint values. */
  pose(root: Matrix4, jointValues: JointValues, into: Float32Array): void {
    this.poses[0].copy(root)
    this.bones.forEach(({ parent, joint, place }, i) => {
      const amount = joint.gain * (jointValues[joint.signal] ?? 0)
      this.poses[i + 1].multiplyMatrices(this.poses[parent], place).multiply(moved(joint, amount))
    })
    for (const [i, pose] of this.poses.entries()) pose.toArray(into, 16 * i)
  }
}

const move = new Matrix4()
const axis = new Vector3()

function moved(joint: Joint, amount: number): Matrix4 {
  if (joint.kind === 'hinge') return move.makeRotationAxis(axis.set(...joint.axis), amount)
  if (joint.kind === 'slide') return move.makeTranslation(axis.set(...joint.axis).multiplyScalar(amount))
  const [x, y] = joint.arm
  const c = Math.cos(amount) - 1
  const s = Math.sin(amount)
  return move.makeTranslation(c * x - s * y, s * x + c * y, 0)
}
