// The lit lenses of the traffic lights of a map.
import { Mesh, Quaternion, type ShaderMaterial, Vector3 } from 'three'

import { type TrafficLightFrame, TrafficLightState } from '../messages'
import { meshParts } from './geometry'
import type { Asset } from './glb'
import { Skeleton } from './skeleton'

/** A lit lens is drawn so far ahead of the dark one [m]. */
const GAP = 0.001
const STATES: Record<string, TrafficLightState> = {
  red: TrafficLightState.RED,
  yellow: TrafficLightState.YELLOW,
  green: TrafficLightState.GREEN,
}

/** A lens as it glows, in the map frame. */
export class Lens {
  readonly mesh: Mesh
  /** Where it looks. */
  readonly aim: Vector3
  readonly position: Vector3
  readonly color: Vector3

  constructor(
    readonly light: string,
    private readonly state: TrafficLightState,
    [asset, material]: [Asset, ShaderMaterial],
  ) {
    const [node] = asset.nodes
    const [{ geometry }] = meshParts(asset, new Skeleton(asset.nodes), 'full', true)
    this.mesh = new Mesh(geometry, material)
    this.aim = new Vector3(1, 0, 0).applyQuaternion(new Quaternion(...node.orientation))
    this.position = new Vector3(...node.position)
    this.color = new Vector3(...(node.surfaces.full?.[0]?.emission ?? [0, 0, 0]))
    this.mesh.position.copy(this.aim).multiplyScalar(GAP)
  }

  /** Makes it visible if its light has its colour. */
  show(lights: Record<string, TrafficLightFrame>): void {
    this.mesh.visible = lights[this.light]?.state === this.state
  }
}

/** The lenses of a map. */
export function lensesOf(map: Asset, material: () => ShaderMaterial): Lens[] {
  const nodes = map.nodes.filter(({ lamp }) => lamp in STATES)
  if (nodes.length === 0) return []
  const own = material()
  return nodes.map((node) => {
    const full = node.surfaces.full?.filter(({ emission }) => Math.max(...emission) > 0)
    const lit = { ...map, nodes: [{ ...node, parent: -1, lamp: '', surfaces: { full } }] }
    return new Lens(node.name.replace(/\.[^.]*$/, ''), STATES[node.lamp], [lit, own])
  })
}
