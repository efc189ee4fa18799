// Reads the .glb files of the simulator: nodes with surfaces in three levels of detail, joints and lamps.

export type Detail = 'full' | 'reduced' | 'shadow'
export type Vector = [number, number, number]

/** How a node moves with a signal of its vehicle. */
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
  /** Share of the sky that each vertex sees, three times; null: all. */
  open: Float32Array | null
  indices: Uint16Array | Uint32Array
  color: Vector
  /** Whether the page may paint it in the colour of the vehicle. */
  isPaint: boolean
  /** Of a facade: of its lit windows. */
  emission: Vector
  roughness: number
  metallic: number
  /** Index into `Asset.images`; -1: no texture. */
  image: number
}

/** A rigid part. `parent` is the index of an earlier node, or -1. The quaternion is xyzw. */
export interface Node {
  name: string
  parent: number
  position: Vector
  orientation: [number, number, number, number]
  joint: Joint | null
  lamp: string
  surfaces: Partial<Record<Detail, Surface[]>>
}

/** Paint and shade on the ground: `STRIP` and `Strips` of graphics/assets/asset.py. */
export interface Strips {
  vertices: Float32Array
  triangles: Uint32Array
}

export interface Asset {
  nodes: Node[]
  /** Textures (sRGB). */
  images: ImageBitmap[]
  /** Names of the textures; a part of a map has only these, and the textures are those of the map. */
  imageNames: string[]
  /** Index of the noise of the clouds; -1: none. */
  clouds: number
  strips: Strips | null
  /** Of a map: where its ground begins to fade into the horizon; null: nowhere. */
  extent: Extent | null
}

/** x_min, y_min, x_max, y_max [m]. */
export type Extent = [number, number, number, number]

const MAGIC = 0x46546c67
const FLOAT = 5126
const UINT16 = 5123

/** The parts of the glTF 2.0 tree that are read. The files come from the simulator, so they are not validated. */
interface Tree {
  nodes: TreeNode[]
  meshes?: Mesh[]
  images?: { name: string; bufferView?: number; mimeType?: string }[]
  textures?: { source: number }[]
  materials: Material[]
  accessors: { bufferView: number; type: 'SCALAR' | 'VEC2' | 'VEC3'; componentType: number; count: number }[]
  bufferViews: { byteOffset: number; byteLength: number }[]
}

interface TreeNode {
  name: string
  children?: number[]
  mesh?: number
  translation?: Vector
  rotation?: [number, number, number, number]
  extras?: {
    detail?: Detail
    joint?: Joint
    lamp?: string
    strips?: { vertices: number; triangles: number }
    extent?: Extent
  }
}

interface Mesh {
  primitives: {
    attributes: { POSITION: number; NORMAL: number; TEXCOORD_0?: number; COLOR_0?: number }
    indices: number
    material: number
  }[]
}

interface Material {
  extras?: { paint?: boolean; beneath?: number; windows?: Vector }
  pbrMetallicRoughness: {
    baseColorFactor: [...Vector, number]
    baseColorTexture?: { index: number }
    roughnessFactor: number
    metallicFactor: number
  }
  emissiveFactor?: Vector
  extensions?: { KHR_materials_emissive_strength?: { emissiveStrength: number } }
}

/** Loads an asset, and reports each part [bytes]; throws an Error with the URL if that fails. */
export async function loadAsset(url: URL, received: (bytes: number) => void): Promise<Asset> {
  const answer = await fetch(url)
  if (!answer.ok) throw new Error(`${url.pathname}: ${answer.status} ${answer.statusText}`)
  const count = new TransformStream<Uint8Array, Uint8Array>({
    transform(part, controller) {
      received(part.byteLength)
      controller.enqueue(part)
    },
  })
  return readAsset(await new Response(answer.body?.pipeThrough(count)).arrayBuffer())
}

/** Reads an asset from the contents of a file. */
export async function readAsset(data: ArrayBuffer): Promise<Asset> {
  const view = new DataView(data)
  if (view.getUint32(0, true) !== MAGIC) throw new Error('not a binary glTF file')
  const length = view.getUint32(12, true)
  const tree: Tree = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 20, length)))
  const binary = 28 + length
  const written = tree.images ?? []
  const images = written.flatMap((image) => {
    if (image.bufferView === undefined) return []
    const at = tree.bufferViews[image.bufferView]
    const bytes = new Uint8Array(data, binary + at.byteOffset, at.byteLength)
    return createImageBitmap(new Blob([bytes], { type: image.mimeType }), { colorSpaceConversion: 'none' })
  })
  const imageNames = written.map((image) => image.name)
  const own = tree.nodes[0].extras?.strips
  const strips = own && {
    vertices: accessorValues(own.vertices, tree, data, binary) as Float32Array,
    triangles: accessorValues(own.triangles, tree, data, binary) as Uint32Array,
  }
  return {
    nodes: nodes(tree, data, binary),
    images: await Promise.all(images),
    imageNames,
    clouds: imageNames.indexOf('clouds'),
    strips: strips ?? null,
    extent: tree.nodes[0].extras?.extent ?? null,
  }
}

function accessorValues(number: number, tree: Tree, data: ArrayBuffer, binary: number) {
  const accessor = tree.accessors[number]
  const view = tree.bufferViews[accessor.bufferView]
  const size = { SCALAR: 1, VEC2: 2, VEC3: 3 }[accessor.type]
  const Values = { [FLOAT]: Float32Array, [UINT16]: Uint16Array }[accessor.componentType] ?? Uint32Array
  return new Values(data, binary + view.byteOffset, accessor.count * size)
}

function nodes(tree: Tree, data: ArrayBuffer, binary: number): Node[] {
  const surfaces = (tree.meshes ?? []).map((mesh) => meshSurfaces(mesh, tree, data, binary))
  const written = tree.nodes
  const parents = new Map<number, number>()
  for (const [i, node] of written.entries()) for (const child of node.children ?? []) parents.set(child, i)
  const own: Node[] = []
  const indexOf = new Map<number, number>()
  written.forEach((node, i) => {
    // the first node converts z-up to the y-up of glTF; the scene stays z-up
    if (i === 0 || node.extras?.detail) return
    indexOf.set(i, own.length)
    const details: Node['surfaces'] = {}
    if (node.mesh !== undefined) details.full = surfaces[node.mesh]
    for (const child of node.children ?? []) {
      const { extras, mesh } = written[child]
      if (extras?.detail && mesh !== undefined) details[extras.detail] = surfaces[mesh]
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

function meshSurfaces(mesh: Mesh, tree: Tree, data: ArrayBuffer, binary: number): Surface[] {
  const values = (number: number) => accessorValues(number, tree, data, binary)
  return mesh.primitives.map((primitive) => {
    const own = tree.materials[primitive.material]
    const material = tree.materials[own.extras?.beneath ?? primitive.material] // paint is drawn from the strips
    const finish = material.pbrMetallicRoughness
    const strength = material.extensions?.KHR_materials_emissive_strength?.emissiveStrength ?? 1
    const { TEXCOORD_0: uvs, COLOR_0: open } = primitive.attributes
    const texture = finish.baseColorTexture
    const [red, green, blue] = finish.baseColorFactor
    const [er, eg, eb] = material.emissiveFactor ?? [0, 0, 0]
    return {
      positions: values(primitive.attributes.POSITION) as Float32Array,
      normals: values(primitive.attributes.NORMAL) as Float32Array,
      uvs: uvs === undefined ? null : (values(uvs) as Float32Array),
      open: open === undefined ? null : (values(open) as Float32Array),
      indices: values(primitive.indices) as Uint16Array | Uint32Array,
      color: [red, green, blue],
      isPaint: material.extras?.paint ?? false,
      emission: material.extras?.windows ?? [er * strength, eg * strength, eb * strength],
      roughness: finish.roughnessFactor,
      metallic: finish.metallicFactor,
      image: texture ? (tree.textures?.[texture.index].source ?? -1) : -1,
    }
  })
}
