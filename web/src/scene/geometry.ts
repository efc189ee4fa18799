// Merges the surfaces of an asset at one level of detail into one geometry for each texture.
import { BufferAttribute, BufferGeometry, Matrix3, Vector3 } from 'three'
import type { Asset, Detail, Surface, Vector } from './glb'
import { LAMPS } from './lamps'
import type { Skeleton } from './skeleton'

export interface MeshPart {
  geometry: BufferGeometry
  /** Index into `Asset.images`; -1: no texture. */
  image: number
}

/** Kinds of surfaces for the shader: horizontal ground, other matt surfaces, glossy surfaces. */
const FLAT = 0
const MATT = 1
const SHINY = 2

interface Part {
  surface: Surface
  node: number
}

/** The geometry of an asset by texture. A moving asset has no ground surfaces. `paint`: linear RGB instead of its own. */
export function meshParts(
  asset: Asset,
  skeleton: Skeleton,
  detail: Detail,
  isMoving: boolean,
  paint: Vector | null = null,
): MeshPart[] {
  const parts = new Map<number, Part[]>()
  asset.nodes.forEach(({ surfaces }, node) => {
    for (const surface of surfaces[detail] ?? []) {
      const own = parts.get(surface.image)
      if (own) own.push({ surface, node })
      else parts.set(surface.image, [{ surface, node }])
    }
  })
  return [...parts].map(([image, own]) => ({ image, geometry: mergeSurfaces(asset, skeleton, own, isMoving, paint) }))
}

/** Positions and bones of all surfaces, for shadow maps; null if the asset lacks that level of detail. */
export function shadowGeometry(asset: Asset, skeleton: Skeleton, detail: Detail): BufferGeometry | null {
  const parts = asset.nodes.flatMap(({ surfaces }, node) =>
    (surfaces[detail] ?? []).map((surface) => ({ surface, node })),
  )
  if (parts.length === 0) return null
  const geometry = mergeSurfaces(asset, skeleton, parts, true, null)
  for (const name of ['normal', 'color', 'emission', 'uv', 'open', 'finish']) geometry.deleteAttribute(name)
  return geometry
}

function mergeSurfaces(
  asset: Asset,
  skeleton: Skeleton,
  parts: readonly Part[],
  isMoving: boolean,
  paint: Vector | null,
): BufferGeometry {
  const vertices = parts.reduce((sum, { surface }) => sum + surface.positions.length / 3, 0)
  const count = parts.reduce((sum, { surface }) => sum + surface.indices.length, 0)
  const position = new Float32Array(3 * vertices)
  const normal = new Float32Array(3 * vertices)
  const color = new Float32Array(3 * vertices)
  const emission = new Float32Array(3 * vertices)
  const uv = new Float32Array(2 * vertices)
  const open = new Float32Array(vertices).fill(1)
  const finish = new Float32Array(3 * vertices) // roughness, metallic, kind
  const bones = new Float32Array(2 * vertices) // bone, lamp
  const indices = new Uint32Array(count)
  const point = new Vector3()
  const turn = new Matrix3()
  let first = 0
  let at = 0
  for (const { surface, node } of parts) {
    const place = skeleton.restPoseOf[node]
    const lamp = asset.nodes[node].lamp
    const isLens = lamp !== '' && !LAMPS.includes(lamp) // of a traffic light: dark, see lenses.ts
    const own = surface.positions.length / 3
    const skinned = [skeleton.boneOf[node], 1 + LAMPS.indexOf(lamp)]
    const finished = [surface.roughness, surface.metallic, kindOf(surface, isMoving)]
    turn.setFromMatrix4(place)
    for (let i = 0; i < own; i++) {
      point
        .fromArray(surface.positions, 3 * i)
        .applyMatrix4(place)
        .toArray(position, 3 * (first + i))
      point
        .fromArray(surface.normals, 3 * i)
        .applyMatrix3(turn)
        .toArray(normal, 3 * (first + i))
      color.set(surface.isPaint && paint ? paint : surface.color, 3 * (first + i))
      if (!isLens) emission.set(surface.emission, 3 * (first + i))
      finish.set(finished, 3 * (first + i))
      bones.set(skinned, 2 * (first + i))
    }
    if (surface.uvs) uv.set(surface.uvs, 2 * first)
    if (surface.open) for (let i = 0; i < own; i++) open[first + i] = surface.open[3 * i]
    for (let i = 0; i < surface.indices.length; i++) indices[at + i] = surface.indices[i] + first
    first += own
    at += surface.indices.length
  }
  const geometry = new BufferGeometry()
  geometry.setAttribute('position', new BufferAttribute(position, 3))
  geometry.setAttribute('normal', new BufferAttribute(normal, 3))
  geometry.setAttribute('color', new BufferAttribute(color, 3))
  geometry.setAttribute('emission', new BufferAttribute(emission, 3))
  geometry.setAttribute('uv', new BufferAttribute(uv, 2))
  geometry.setAttribute('open', new BufferAttribute(open, 1))
  geometry.setAttribute('finish', new BufferAttribute(finish, 3))
  geometry.setAttribute('bones', new BufferAttribute(bones, 2))
  geometry.setIndex(new BufferAttribute(vertices < 65536 ? new Uint16Array(indices) : indices, 1))
  geometry.computeBoundingSphere()
  geometry.computeBoundingBox()
  return geometry
}

function kindOf(surface: Surface, isMoving: boolean): number {
  let isFlat = !isMoving
  for (let i = 2; isFlat && i < surface.normals.length; i += 3) isFlat = surface.normals[i] > 0.999
  if (isFlat) return FLAT
  return surface.roughness >= 0.6 && surface.metallic === 0 ? MATT : SHINY
}
