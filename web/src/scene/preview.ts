// Shows the thing that is moved in Edit mode where it will be placed.
import { Vector3 } from 'three'

import type { Scene } from '../messages'
import type { Placement } from '../store'
import type { WorldState } from './motion'

const UP = new Vector3(0, 0, 1)

export function showPreview(state: WorldState, preview: Placement | null, scene: Scene): void {
  const thing = preview && (state.vehicles.get(preview.name) ?? state.objects.get(preview.name))
  if (!thing) return
  const size = scene.object_sizes[preview.name]
  thing.position.set(preview.x, preview.y, size ? 0.5 * size[2] : thing.position.z)
  thing.orientation.setFromAxisAngle(UP, preview.yaw)
}
