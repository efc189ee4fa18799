// The simulator's .glb files: named nodes with surfaces in three details, joints and lamps (render/glb.py).

export type Detail = 'full' | 'reduced' | 'shadow'
export type Vector = [number, number, number]

/** How a node moves by a signal of its vehicle; see render/asset.py. */
export interface Joint {
  kind: 'hinge' | 'slide' | 'crank'
  signal: string
  axis: Vector
  gain: number
  arm: Vector
}

export interface Surface {
  positions: Float32Array
  normals: Float32Array
  uvs: Float32Array | null
  indices: Uint16Array | Uint32Array
  color: Vector
  emission: Vector
  roughness: number
  metallic: number
  /** Number of the picture in `Asset.pictures`, -1: none. */
  picture: number
}

/** A rigid piece; `parent` is the index of a node listed before, -1: none. Quaternion xyzw. */
export interface Node {
  name: string
  parent: number
  position: Vector
  orientation: [number, number, number, number]
  joint: Joint | null
  lamp: string
  surfaces: Partial<Record<Detail, Surface[]>>
}

export interface Asset {
  nodes: Node[]
  /** sRGB, to be turned into textures. */
  pictures: ImageBitmap[]
}

const MAGIC = 0x46546c67
const FLOAT = 5126
const UINT16 = 5123

/** The file is ours: its tree is as glTF 2.0 says. */
type Tree = Record<string, any>

/** The asset at that address; throws an Error with the address if it cannot be had. */
export async function loadAsset(url: URL): Promise<Asset> {
  const answer = await fetch(url)
  if (!answer.ok) throw new Error(`${url.pathname}: ${answer.status} ${answer.statusText}`)
  return readAsset(await answer.arrayBuffer())
}

/** The asset of a file's content. */
export async function readAsset(data: ArrayBuffer): Promise<Asset> {
  const view = new DataView(data)
  if (view.getUint32(0, true) !== MAGIC) throw new Error('not a file of binary glTF')
  const length = view.getUint32(12, true)
  const tree: Tree = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 20, length)))
  const binary = 28 + length
  const pictures = ((tree.images ?? []) as Tree[]).map((image) => {
    const at = tree.bufferViews[image.bufferView]
    const bytes = new Uint8Array(data, binary + at.byteOffset, at.byteLength)
    return createImageBitmap(new Blob([bytes], { type: image.mimeType }), { colorSpaceConversion: 'none' })
  })
  return { nodes: nodes(tree, data, binary), pictures: await Promise.all(pictures) }
}

function nodes(tree: Tree, data: ArrayBuffer, binary: number): Node[] {
  const surfaces = ((tree.meshes ?? []) as Tree[]).map((mesh) => meshSurfaces(mesh, tree, data, binary))
  const written: Tree[] = tree.nodes
  const parents = new Map<number, number>()
  written.forEach((node, i) => (node.children ?? []).forEach((child: number) => parents.set(child, i)))
  const own: Node[] = []
  const indexOf = new Map<number, number>()
  written.forEach((node, i) => {
    // the first is the root, which turns z-up to glTF's y-up: we stay with z
    if (i === 0 || node.extras?.detail) return
    indexOf.set(i, own.length)
    const details: Node['surfaces'] = {}
    if (node.mesh !== undefined) details.full = surfaces[node.mesh]
    for (const child of node.children ?? []) {
      const detail = written[child].extras?.detail as Detail | undefined
      if (detail) details[detail] = surfaces[written[child].mesh]
    }
    own.push({
      name: node.name,
      parent: indexOf.get(parents.get(i) ?? 0) ?? -1,
      position: node.translation ?? [0, 0, 0],
      orientation: node.rotation ?? [0, 0, 0, 1],
      joint: node.extras?.joint ?? null,
      lamp: node.extras?.lamp ?? '',
      surfaces: details,
    })
  })
  return own
}

function meshSurfaces(mesh: Tree, tree: Tree, data: ArrayBuffer, binary: number): Surface[] {
  const values = (number: number): Float32Array | Uint16Array | Uint32Array => {
    const accessor = tree.accessors[number]
    const view = tree.bufferViews[accessor.bufferView]
    const size = { SCALAR: 1, VEC2: 2, VEC3: 3 }[accessor.type as 'SCALAR' | 'VEC2' | 'VEC3']
    const Values = { [FLOAT]: Float32Array, [UINT16]: Uint16Array }[accessor.componentType as number] ?? Uint32Array
    return new Values(data, binary + view.byteOffset, accessor.count * size)
  }
  return (mesh.primitives as Tree[]).map((primitive) => {
    const material = tree.materials[primitive.material]
    const finish = material.pbrMetallicRoughness
    const strength = material.extensions?.KHR_materials_emissive_strength?.emissiveStrength ?? 1
    const uvs = primitive.attributes.TEXCOORD_0
    const texture = finish.baseColorTexture
    return {
      positions: values(primitive.attributes.POSITION) as Float32Array,
      normals: values(primitive.attributes.NORMAL) as Float32Array,
      uvs: uvs === undefined ? null : (values(uvs) as Float32Array),
      indices: values(primitive.indices) as Uint16Array | Uint32Array,
      color: finish.baseColorFactor.slice(0, 3),
      emission: (material.emissiveFactor ?? [0, 0, 0]).map((factor: number) => factor * strength),
      roughness: finish.roughnessFactor,
      metallic: finish.metallicFactor,
      picture: texture ? tree.textures[texture.index].source : -1,
    }
  })
}
