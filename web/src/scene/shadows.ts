// Shadow maps as in render/shadows.py: of static objects, of each vehicle, and of each headlight.

import type { IUniform, WebGLRenderer } from 'three'
import {
  Box3,
  type BufferGeometry,
  Camera,
  DepthTexture,
  DoubleSide,
  GLSL3,
  InstancedMesh,
  LessEqualCompare,
  LinearFilter,
  Matrix3,
  Matrix4,
  Mesh,
  type Object3D,
  Raycaster,
  RedFormat,
  Scene,
  ShaderMaterial,
  UnsignedIntType,
  Vector3,
  Vector4,
  WebGLRenderTarget,
} from 'three'

import { type ActiveLamps, BEAM_SLOTS } from './lamps'
import type { Profile } from './quality'
import { CASTER_SLOTS, CASTER_TILES, DEPTH_FRAGMENT, DEPTH_VERTEX } from './shaders'

/** As in render/shadows.py: [m], and texels. */
const FINE = 0.006
const NEAR = 4
const NEAR_STEP = 2
const SKIN = 1.2
/** Between a camera and the wall behind it [m]. */
const CLEARANCE = 0.04

/** Material for depth maps: with an offset against shadow acne, and two-sided, because thin parts cast shadows too. */
export function depthMaterial(bones: IUniform<Float32Array> | null): ShaderMaterial {
  return new ShaderMaterial({
    ...{ vertexShader: DEPTH_VERTEX, fragmentShader: DEPTH_FRAGMENT, glslVersion: GLSL3, side: DoubleSide },
    ...{ defines: bones ? { SKINNED: 1 } : {}, uniforms: bones ? { bone_poses: bones } : {} },
    ...{ polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 2, colorWrite: false },
  })
}

/** Rotation from the map frame to the sun frame: x and y across the light, z away from the sun. */
export function sunAxes(direction: readonly number[]): Matrix3 {
  const z = new Vector3(...direction).negate()
  const x = new Vector3(0, 0, 1).cross(z).normalize()
  const y = new Vector3().crossVectors(z, x)
  return new Matrix3().set(x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z)
}

export class Shadows {
  readonly uniforms = {
    still_map: { value: null as DepthTexture | null },
    caster_map: { value: null as DepthTexture | null },
    beam_map: { value: null as DepthTexture | null },
    still_scale: { value: new Vector4(1, 1, 1, 1) },
    still_offset: { value: new Vector4(9, 9, 9, 0) },
    caster_offset: { value: new Float32Array(4 * CASTER_SLOTS) },
    caster_tile: { value: new Float32Array(4 * CASTER_SLOTS) },
    tile_scale: { value: new Vector4() },
    beam_from_map: { value: new Float32Array(16 * BEAM_SLOTS) },
    beam_texel: { value: 0 },
  }
  /** Static shadow casters. */
  readonly staticScene = new Scene()
  /** Whether a static object has moved since its map was drawn. */
  isStaticMapOutdated = true
  private isPrepared = false
  private readonly targets: Record<'still' | 'caster' | 'beam', WebGLRenderTarget | null>
  private readonly lightCamera = new Camera()
  /** Of all static objects, in the sun frame, and their height [m]; and the area for which the map was drawn. */
  private readonly box = new Box3()
  private top = 0
  private drawnArea = ''

  /** `sun` is the rotation from `sunAxes`; `extent` is the radius of the largest vehicle about its origin [m]. */
  constructor(
    private readonly profile: Profile,
    private readonly sun: Matrix3,
    private sunHeight: number,
    private readonly extent: number,
  ) {
    const { stillMap, casterMap, beamMap, softness } = profile
    this.targets = {
      still: softness > 0 ? target(stillMap) : null,
      caster: softness > 0 ? target(casterMap) : null,
      beam: beamMap > 0 ? target(2 * beamMap) : null,
    }
    this.uniforms.still_map.value = this.targets.still?.depthTexture ?? null
    this.uniforms.caster_map.value = this.targets.caster?.depthTexture ?? null
    this.uniforms.beam_map.value = this.targets.beam?.depthTexture ?? null
    this.uniforms.beam_texel.value = 1 / Math.max(2 * beamMap, 1)
    const place = 0.5 / extent
    this.uniforms.tile_scale.value.set(1 / CASTER_TILES, 1 / Math.max(casterMap, 1), place, 1 / (2 * extent + 0.6))
    this.lightCamera.matrixAutoUpdate = this.lightCamera.matrixWorldAutoUpdate = false
  }

  /** Sets the direction towards the sun. */
  setSun(direction: readonly number[]): void {
    this.sun.copy(sunAxes(direction))
    this.sunHeight = direction[2]
    this.isStaticMapOutdated = true
  }

  /** Share of the way from a point to another that is free of walls and buildings. */
  freeShare(from: Vector3, to: Vector3): number {
    const way = pointing.subVectors(to, from)
    sight.far = way.length()
    sight.set(from, way.normalize())
    const solids = this.staticScene.children.filter((one) => one instanceof Mesh && !(one instanceof InstancedMesh))
    const [hit] = sight.intersectObjects(solids, false)
    return hit ? Math.max(hit.distance - CLEARANCE, 0) / sight.far : 1
  }

  /** Clears all maps once, because the shaders also sample maps into which nothing is drawn. */
  prepare(renderer: WebGLRenderer): void {
    if (this.isPrepared) return
    this.isPrepared = true
    for (const map of Object.values(this.targets)) {
      if (!map) continue
      renderer.setRenderTarget(map)
      renderer.clear(false, true, false)
    }
  }

  /** Redraws all maps, after the WebGL context was lost. */
  invalidate(): void {
    this.isPrepared = false
    this.isStaticMapOutdated = true
  }

  /** Draws the shadow map of static objects if one of them, or the area that it covers, has changed. */
  drawStatic(renderer: WebGLRenderer, camera: Camera): void {
    const { still } = this.targets
    if (!still) return
    if (this.isStaticMapOutdated) {
      this.staticScene.updateMatrixWorld()
      this.box.makeEmpty()
      this.top = Math.max(sunBox(this.staticScene, this.sun, this.box), 0)
      if (this.box.isEmpty()) this.box.set(new Vector3(9, 9, 9), new Vector3(10, 10, 10))
      this.box.expandByScalar(0.02)
      this.box.max.z += this.top / this.sunHeight + 0.2 // the length of the longest shadow
    }
    const area = this.area(camera)
    if (!this.isStaticMapOutdated && String(area) === this.drawnArea) return
    this.isStaticMapOutdated = false
    this.drawnArea = String(area)
    const box = this.box.clone()
    if (area) {
      const near = new Box3()
      for (const x of [area[0], area[2]])
        for (const y of [area[1], area[3]])
          for (const z of [0, this.top]) near.expandByPoint(new Vector3(x, y, z).applyMatrix3(this.sun))
      near.min.z = box.min.z
      near.max.z = box.max.z
      if (near.intersectsBox(box)) box.intersect(near)
    }
    const size = box.getSize(new Vector3())
    const scale = this.uniforms.still_scale.value.set(1 / size.x, 1 / size.y, 1 / size.z, 1 / this.profile.stillMap)
    const offset = this.uniforms.still_offset.value
    const texel = Math.max(size.x, size.y) / this.profile.stillMap
    const tile = (2 * this.extent * CASTER_TILES) / this.profile.casterMap
    offset.set(-box.min.x * scale.x, -box.min.y * scale.y, -box.min.z * scale.z, SKIN * Math.max(texel, tile))
    this.aim(scale, offset)
    still.viewport.set(0, 0, still.width, still.height)
    still.scissorTest = false
    renderer.setRenderTarget(still)
    renderer.clear(false, true, false)
    renderer.render(this.staticScene, this.lightCamera)
  }

  /** The ground that the map of static objects covers for a camera, as `Shadows.area` of the simulator; null: all. */
  private area(camera: Camera): number[] | null {
    const size = this.box.getSize(center)
    if (Math.hypot(size.x, size.y) < FINE * this.profile.stillMap) return null
    const eye = camera.position
    const look = camera.getWorldDirection(pointing)
    const height = Math.min(Math.max(eye.z, 0), 10)
    const ahead = Math.min(height / Math.max(-look.z, 1e-3), NEAR - 1 + 4 * height)
    const reach = NEAR + 1.5 * height
    const [x, y] = [eye.x + ahead * look.x, eye.y + ahead * look.y]
    const low = [x, y].map((at) => NEAR_STEP * Math.floor((at - reach) / NEAR_STEP))
    return [...low, ...[x, y].map((at) => NEAR_STEP * Math.ceil((at + reach) / NEAR_STEP))]
  }

  /** Draws each vehicle into its own tile. */
  drawCasters(renderer: WebGLRenderer, vehicles: readonly { root: Matrix4; caster: Object3D }[]): void {
    const { caster } = this.targets
    if (!caster) return
    const edge = caster.width / CASTER_TILES
    const { x: size, z: place, w: depth } = this.uniforms.tile_scale.value
    const scale = new Vector3(place, place, depth)
    vehicles.forEach(({ root, caster: thing }, slot) => {
      const low = center.setFromMatrixPosition(root).applyMatrix3(this.sun).subScalar(this.extent)
      low
        .multiply(scale)
        .negate()
        .toArray(this.uniforms.caster_offset.value, 4 * slot)
      const [row, column] = [Math.floor(slot / CASTER_TILES), slot % CASTER_TILES]
      this.uniforms.caster_tile.value.set([column * size, row * size], 4 * slot)
      this.aim(scale, low)
      this.beginTile(renderer, caster, column * edge, row * edge, edge)
      renderer.render(thing, this.lightCamera)
    })
  }

  /** Draws a tile for each headlight with shadows; the vehicle of the headlight casts no shadow in it. */
  drawBeams(renderer: WebGLRenderer, activeLamps: ActiveLamps, casters: readonly Object3D[]): void {
    const { beam } = this.targets
    if (!beam) return
    const edge = beam.width / 2
    for (let slot = 0; slot < activeLamps.beams; slot++) {
      const [x, y] = [slot % 2, Math.floor(slot / 2)]
      activeLamps.matrix(slot, this.lightCamera.projectionMatrix)
      this.lightCamera.projectionMatrixInverse.copy(this.lightCamera.projectionMatrix).invert()
      this.beginTile(renderer, beam, x * edge, y * edge, edge)
      renderer.render(this.staticScene, this.lightCamera)
      for (const caster of casters) renderer.render(caster, this.lightCamera)
      tile.set(0.25, 0, 0, 0.25 + 0.5 * x, 0, 0.25, 0, 0.25 + 0.5 * y, 0, 0, 0.5, 0.5, 0, 0, 0, 1)
      tile.multiply(this.lightCamera.projectionMatrix).toArray(this.uniforms.beam_from_map.value, 16 * slot)
    }
  }

  private beginTile(renderer: WebGLRenderer, map: WebGLRenderTarget, x: number, y: number, edge: number): void {
    map.viewport.set(x, y, edge, edge)
    map.scissor.set(x, y, edge, edge)
    map.scissorTest = true
    renderer.setRenderTarget(map)
    renderer.clear(false, true, false)
  }

  /** Points the camera along the sun at the box where (sun frame * scale + offset) is in [0, 1]. */
  private aim(scale: { x: number; y: number; z: number }, offset: { x: number; y: number; z: number }): void {
    const s = this.sun.elements // column-major
    const rows = [0, 1, 2].map((row) => [s[row], s[row + 3], s[row + 6]])
    const [a, b, c] = rows.map((row, i) => row.map((value) => 2 * [scale.x, scale.y, scale.z][i] * value))
    const [x, y, z] = [2 * offset.x - 1, 2 * offset.y - 1, 2 * offset.z - 1]
    const clip = this.lightCamera.projectionMatrix
    clip.set(a[0], a[1], a[2], x, b[0], b[1], b[2], y, c[0], c[1], c[2], z, 0, 0, 0, 1)
    this.lightCamera.projectionMatrixInverse.copy(clip).invert()
  }

  dispose(): void {
    for (const map of Object.values(this.targets)) {
      map?.depthTexture?.dispose()
      map?.dispose()
    }
  }
}

function target(edge: number): WebGLRenderTarget {
  const depthTexture = new DepthTexture(edge, edge, UnsignedIntType)
  depthTexture.compareFunction = LessEqualCompare
  depthTexture.minFilter = depthTexture.magFilter = LinearFilter
  return new WebGLRenderTarget(edge, edge, { depthTexture, format: RedFormat, generateMipmaps: false })
}

/** Expands the box in the sun frame by all descendants of `root`; returns their maximum height in the map [m]. */
function sunBox(root: Object3D, sun: Matrix3, box: Box3): number {
  let top = 0
  root.traverse((thing) => {
    const mesh = thing as Object3D & { geometry?: BufferGeometry; count?: number; getMatrixAt?: InstanceMatrix }
    if (!mesh.geometry) return
    const positions = mesh.geometry.getAttribute('position')
    for (let i = 0; i < (mesh.getMatrixAt ? (mesh.count ?? 0) : 1); i++) {
      pose.copy(mesh.matrixWorld)
      mesh.getMatrixAt?.(i, pose)
      for (let k = 0; k < positions.count; k++) {
        center.fromBufferAttribute(positions, k).applyMatrix4(pose)
        top = Math.max(top, center.z)
        box.expandByPoint(center.applyMatrix3(sun))
      }
    }
  })
  return top
}

type InstanceMatrix = (index: number, matrix: Matrix4) => void

const sight = new Raycaster()
const center = new Vector3()
const pointing = new Vector3()
const pose = new Matrix4()
const tile = new Matrix4()
