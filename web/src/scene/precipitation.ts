// Rain streaks and snow flakes before the camera, at other places in each image, as in the images of the cameras.

import type { IUniform } from 'three'
import {
  BufferAttribute,
  BufferGeometry,
  CustomBlending,
  GLSL3,
  Mesh,
  OneFactor,
  OneMinusSrcColorFactor,
  ShaderMaterial,
  Vector2,
  Vector4,
  type WebGLRenderer,
} from 'three'

import type { WorldState } from './motion'
import { PRECIPITATION_FRAGMENT, PRECIPITATION_VERTEX } from './shaders'

/** In an image of the heaviest rain and snow, as `STREAKS` and `FLAKES` of the simulator. */
const STREAKS = 260
const FLAKES = 500
/** Their places change so often [Hz]. */
const RATE = 30

export class Precipitation {
  readonly mesh: Mesh
  private readonly geometry = new BufferGeometry()
  private readonly material: ShaderMaterial
  private readonly own = { seed: { value: 0 }, flakes: { value: 0 }, shape: { value: new Vector4() } }
  private wind = 0

  constructor(shared: Record<string, IUniform>) {
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(18 * (STREAKS + FLAKES)), 3))
    this.material = new ShaderMaterial({
      ...{ vertexShader: PRECIPITATION_VERTEX, fragmentShader: PRECIPITATION_FRAGMENT, glslVersion: GLSL3 },
      ...{ uniforms: { ...shared, ...this.own }, transparent: true, depthTest: false, depthWrite: false },
      ...{ blending: CustomBlending, blendSrc: OneFactor, blendDst: OneMinusSrcColorFactor },
    })
    this.mesh = new Mesh(this.geometry, this.material)
    this.mesh.frustumCulled = false
    this.mesh.renderOrder = 20 // after the sky
    this.mesh.visible = false
    this.mesh.onBeforeRender = (renderer) => this.fit(renderer)
  }

  update({ weather, time }: WorldState): void {
    const [streaks, flakes] = [Math.round(STREAKS * (weather?.rain ?? 0)), Math.round(FLAKES * (weather?.snow ?? 0))]
    this.mesh.visible = streaks + flakes > 0
    this.geometry.setDrawRange(0, 6 * (streaks + flakes))
    this.own.seed.value = Math.floor(RATE * time)
    this.own.flakes.value = streaks
    this.wind = weather?.wind ?? 0
  }

  dispose(): void {
    this.geometry.dispose()
    this.material.dispose()
  }

  /** Sets the size of a pixel of the image that is drawn. */
  private fit(renderer: WebGLRenderer): void {
    const { x, y } = renderer.getDrawingBufferSize(size)
    const pixel = 2 * Math.max(1, y / 480)
    this.own.shape.value.set(pixel / x, pixel / y, 0.1 + 0.9 * this.wind, 0)
    this.material.uniformsNeedUpdate = true
  }
}

const size = new Vector2()
