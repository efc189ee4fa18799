// The triangles of an asset in one detail, as few draws as possible: one for each picture.
import { BufferAttribute, BufferGeometry, Matrix3, Vector3 } from 'three'

import { LAMPS } from './lamps'
import type { Asset, Detail, Surface } from './glb'
import type { Rig } from './rig'

export interface Piece {
  geometry: BufferGeometry
  /** Number of the asset's picture, -1: none. */
  picture: number
}

/** Level ground, all of whose normals are up; other things without gloss; all else. */
const FLAT = 0
const MATT = 1
const SHINY = 2

interface Part {
  surface: Surface
  node: number
}

/** Pieces of the asset; what a moving asset consists of is never level ground. */
export function pieces(asset: Asset, rig: Rig, detail: Detail, isMoving: boolean): Piece[] {
  const parts = new Map<number, Part[]>()
  asset.nodes.forEach(({ surfaces }, node) => {
    for (const surface of surfaces[detail] ?? []) {
      const own = parts.get(surface.picture)
      if (own) own.push({ surface, node })
      else parts.set(surface.picture, [{ surface, node }])
    }
  })
  return [...parts].map(([picture, own]) => ({ picture, geometry: merged(asset, rig, own, isMoving) }))
}

/** Positions and bones alone, of all surfaces: for shadow maps. */
export function outline(asset: Asset, rig: Rig, detail: Detail): BufferGeometry | null {
  const parts = asset.nodes.flatMap(({ surfaces }, node) =>
    (surfaces[detail] ?? []).map((surface) => ({ surface, node })),
  )
  if (parts.length === 0) return null
  const geometry = merged(asset, rig, parts, true)
  for (const name of ['normal', 'color', 'emission', 'uv', 'finish']) geometry.deleteAttribute(name)
  return geometry
}

function merged(asset: Asset, rig: Rig, parts: readonly Part[], isMoving: boolean): BufferGeometry {
  const vertices = parts.reduce((sum, { surface }) => sum + surface.positions.length / 3, 0)
  const count = parts.reduce((sum, { surface }) => sum + surface.indices.length, 0)
  const position = new Float32Array(3 * vertices)
  const normal = new Float32Array(3 * vertices)
  const color = new Float32Array(3 * vertices)
  const emission = new Float32Array(3 * vertices)
  const uv = new Float32Array(2 * vertices)
  const finish = new Float32Array(3 * vertices) // roughness, metallic, kind
  const bones = new Float32Array(2 * vertices) // bone, lamp
  const indices = new Uint32Array(count)
  const point = new Vector3()
  const turn = new Matrix3()
  let first = 0
  let at = 0
  for (const { surface, node } of parts) {
    const place = rig.placeOf[node]
    const lamp = asset.nodes[node].lamp
    const own = surface.positions.length / 3
    const rigged = [rig.boneOf[node], lamp ? 1 + LAMPS.indexOf(lamp) : 0]
    const finished = [surface.roughness, surface.metallic, kindOf(surface, isMoving)]
    turn.setFromMatrix4(place)
    for (let i = 0; i < own; i++) {
      point.fromArray(surface.positions, 3 * i).applyMatrix4(place).toArray(position, 3 * (first + i))
      point.fromArray(surface.normals, 3 * i).applyMatrix3(turn).toArray(normal, 3 * (first + i))
      color.set(surface.color, 3 * (first + i))
      emission.set(surface.emission, 3 * (first + i))
      finish.set(finished, 3 * (first + i))
      bones.set(rigged, 2 * (first + i))
    }
    if (surface.uvs) uv.set(surface.uvs, 2 * first)
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
