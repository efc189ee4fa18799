// The bones of an asset: the nodes that move, each against the one above it. Bone 0 is the asset itself.
import { Matrix4, Quaternion, Vector3 } from 'three'

import type { Joint, Node } from './glb'

/** A vehicle has no more. */
export const BONES = 24

/** Value of a signal that a joint names: 'steering', 'spin_front_left', 'compression_rear_right' ... */
export type Signals = Record<string, number>

interface Bone {
  parent: number
  joint: Joint
  /** In the axes of the parent at rest. */
  place: Matrix4
}

export class Rig {
  /** Of each node: the bone that carries it, and its pose in that bone's axes at rest. */
  readonly boneOf: number[] = []
  readonly placeOf: Matrix4[] = []
  private readonly bones: Bone[] = []
  private readonly poses: Matrix4[] = [new Matrix4()]

  constructor(nodes: readonly Node[]) {
    const one = new Vector3(1, 1, 1)
    for (const node of nodes) {
      const own = new Matrix4().compose(new Vector3(...node.position), new Quaternion(...node.orientation), one)
      let place = node.parent < 0 ? own : own.premultiply(this.placeOf[node.parent])
      let bone = node.parent < 0 ? 0 : this.boneOf[node.parent]
      if (node.joint) {
        this.bones.push({ parent: bone, joint: node.joint, place })
        this.poses.push(new Matrix4())
        bone = this.bones.length
        place = new Matrix4()
      }
      this.boneOf.push(bone)
      this.placeOf.push(place)
    }
    if (this.poses.length > BONES) throw new Error(`a rig of ${this.poses.length} bones; ${BONES} can be drawn`)
  }

  /** Map from each bone, column by column, for the asset at `root` and the signals that its joints name. */
  pose(root: Matrix4, signals: Signals, into: Float32Array): void {
    this.poses[0].copy(root)
    this.bones.forEach(({ parent, joint, place }, i) => {
      const amount = joint.gain * (signals[joint.signal] ?? 0)
      this.poses[i + 1].multiplyMatrices(this.poses[parent], place).multiply(moved(joint, amount))
    })
    this.poses.forEach((pose, i) => pose.toArray(into, 16 * i))
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
