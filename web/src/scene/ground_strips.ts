// Paint and shade on the ground, drawn into an image of their own, which the shader of the ground reads.

import type { Camera, WebGLRenderer } from 'three'
import {
  BufferAttribute,
  BufferGeometry,
  CustomBlending,
  DoubleSide,
  GLSL3,
  Group,
  HalfFloatType,
  InterleavedBuffer,
  InterleavedBufferAttribute,
  Matrix4,
  Mesh,
  NearestFilter,
  OneFactor,
  RGFormat,
  ShaderMaterial,
  UnsignedByteType,
  Vector2,
  WebGLRenderTarget,
} from 'three'

import type { Strips } from './glb'
import { STRIP_FRAGMENT, STRIP_VERTEX } from './shaders'

/** Attributes of a vertex, and the number of floats of each. */
const FIELDS = { place: 2, outward: 4, strip: 4, amounts: 2 }

export class GroundStrips {
  readonly uniform = { strip_map: { value: null as WebGLRenderTarget['texture'] | null } }
  private readonly own = { clip_from_map: { value: new Matrix4() }, half_size: { value: new Vector2() } }
  private readonly geometries: BufferGeometry[]
  private readonly material: ShaderMaterial
  private readonly meshes = new Group()
  private target: WebGLRenderTarget | null = null

  constructor(strips: readonly Strips[]) {
    this.geometries = strips.map(geometryOf)
    this.material = new ShaderMaterial({
      ...{ vertexShader: STRIP_VERTEX, fragmentShader: STRIP_FRAGMENT, glslVersion: GLSL3, uniforms: this.own },
      ...{ depthTest: false, depthWrite: false, transparent: true, side: DoubleSide },
      ...{ blending: CustomBlending, blendSrc: OneFactor, blendDst: OneFactor },
    })
    for (const geometry of this.geometries) {
      const mesh = new Mesh(geometry, this.material)
      mesh.frustumCulled = false
      this.meshes.add(mesh)
    }
  }

  /** Draws what a camera sees, for an image of that size [pixels]. */
  draw(renderer: WebGLRenderer, camera: Camera, width: number, height: number): void {
    if (this.target?.width !== width || this.target.height !== height) {
      this.target?.dispose()
      const type = renderer.extensions.has('EXT_color_buffer_float') ? HalfFloatType : UnsignedByteType
      const filters = { minFilter: NearestFilter, magFilter: NearestFilter, generateMipmaps: false }
      this.target = new WebGLRenderTarget(width, height, { format: RGFormat, type, depthBuffer: false, ...filters })
      this.uniform.strip_map.value = this.target.texture
    }
    this.own.clip_from_map.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
    this.own.half_size.value.set(width / 2, height / 2)
    renderer.setRenderTarget(this.target)
    renderer.clear(true, false, false)
    renderer.render(this.meshes, camera)
  }

  dispose(): void {
    this.target?.dispose()
    for (const geometry of this.geometries) geometry.dispose()
    this.material.dispose()
  }
}

function geometryOf(strips: Strips): BufferGeometry {
  const geometry = new BufferGeometry()
  const values = new InterleavedBuffer(strips.vertices, 12)
  let offset = 0
  for (const [name, size] of Object.entries(FIELDS)) {
    geometry.setAttribute(name, new InterleavedBufferAttribute(values, size, offset))
    offset += size
  }
  geometry.setIndex(new BufferAttribute(strips.triangles, 1))
  return geometry
}
