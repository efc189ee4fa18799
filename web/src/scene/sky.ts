// The sky: one triangle that covers the image behind all objects.

import type { Camera, IUniform, Texture } from 'three'
import { BufferAttribute, BufferGeometry, GLSL3, LessEqualDepth, Matrix4, Mesh, ShaderMaterial } from 'three'

import { SKY_FRAGMENT, SKY_VERTEX } from './shaders'

export class Sky {
  readonly mesh: Mesh
  private readonly geometry = new BufferGeometry()
  private readonly material: ShaderMaterial
  private readonly mapFromClip = new Matrix4()

  /** `clouds`: their noise, if there is any. */
  constructor(shared: Record<string, IUniform>, clouds: Texture | null) {
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3))
    this.material = new ShaderMaterial({
      ...{ vertexShader: SKY_VERTEX, fragmentShader: SKY_FRAGMENT, glslVersion: GLSL3 },
      ...{ uniforms: { ...shared, map_from_clip: { value: this.mapFromClip }, clouds: { value: clouds } } },
      ...{ defines: { STARS: 1, DAWN: 1, ...(clouds ? { CLOUDS: 1 } : {}) } },
      ...{ depthWrite: false, depthFunc: LessEqualDepth },
    })
    this.mesh = new Mesh(this.geometry, this.material)
    this.mesh.frustumCulled = false
    this.mesh.renderOrder = 10 // after the objects, so that hidden pixels are not shaded
  }

  /** Draws haze or clear air. */
  setHazy(isHazy: boolean): void {
    setFlags(this.material, isHazy ? ['AIR'] : [])
  }

  /** Sets the view directions from a camera. */
  prepare(camera: Camera): void {
    this.mapFromClip.multiplyMatrices(camera.matrixWorld, camera.projectionMatrixInverse)
  }

  dispose(): void {
    this.geometry.dispose()
    this.material.dispose()
  }
}

const FLAGS = ['AIR', 'WET', 'SNOW', 'WINDOWS']

/** Compiles a material with these flags of weather and dusk, if they have changed. */
export function setFlags(material: ShaderMaterial, flags: string[]): void {
  for (const flag of FLAGS) {
    if (flags.includes(flag) === flag in material.defines) continue
    if (flags.includes(flag)) material.defines[flag] = 1
    else delete material.defines[flag]
    material.needsUpdate = true
  }
}
