// What is in the air before the camera, as in the images of the cameras: rain streaks and snow flakes, at other places in
// each image, drops on the lens, and light of headlights in fog.

import type { Camera, IUniform } from 'three'
import {
  BufferAttribute,
  BufferGeometry,
  CustomBlending,
  GLSL3,
  Matrix4,
  Mesh,
  OneFactor,
  OneMinusSrcColorFactor,
  ShaderMaterial,
  Vector2,
  Vector4,
  type WebGLRenderer,
} from 'three'

import { cloudsOf } from './daylight'
import type { WorldState } from './motion'
import { BEAM_FOG_FRAGMENT, BEAM_FOG_VERTEX, PRECIPITATION_FRAGMENT, PRECIPITATION_VERTEX } from './shaders'

/** In an image of the heaviest rain and snow, as `STREAKS`, `FLAKES` and `DROPS` of the simulator. */
const STREAKS = 260
const FLAKES = 500
const DROPS = 14
/** Columns and rows of the grid, as `BEAM_FOG_CELLS` of the simulator. */
const BEAM_FOG_CELLS = [48, 36]
/** The places of streaks and flakes change so often [Hz]. */
const RATE = 30
/** As `CLOUD_DRIFT` of the simulator. */
const CLOUD_DRIFT = 0.004

export class Precipitation {
  readonly meshes: Mesh[]
  private readonly geometry = new BufferGeometry()
  private readonly fogGeometry = new BufferGeometry()
  private readonly materials: ShaderMaterial[]
  private readonly mapFromClip = new Matrix4()
  private readonly own = {
    ...{ seed: { value: 0 }, flakes: { value: 0 }, drops: { value: 0 }, shape: { value: new Vector4() } },
    map_from_clip: { value: this.mapFromClip },
  }
  private wind = 0
  private time = 0

  /** `shared`: the uniforms of the light; `head_count`: number of headlights. */
  constructor(private readonly shared: Record<string, IUniform>) {
    const count = STREAKS + FLAKES + DROPS
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(18 * count), 3))
    const [columns, rows] = BEAM_FOG_CELLS
    this.fogGeometry.setAttribute('position', new BufferAttribute(new Float32Array(3 * (columns + 1) * (rows + 1)), 3))
    this.fogGeometry.setIndex(grid(columns, rows))
    const uniforms = { ...shared, ...this.own, heads: shared.head_count }
    const shaders = [
      { vertexShader: BEAM_FOG_VERTEX, fragmentShader: BEAM_FOG_FRAGMENT },
      { vertexShader: PRECIPITATION_VERTEX, fragmentShader: PRECIPITATION_FRAGMENT },
    ]
    this.materials = shaders.map((pair, i) => {
      return new ShaderMaterial({
        ...{ ...pair, uniforms, glslVersion: GLSL3, transparent: true, depthTest: i === 0, depthWrite: false },
        ...{ blending: CustomBlending, blendSrc: OneFactor, blendDst: OneMinusSrcColorFactor },
      })
    })
    this.meshes = this.materials.map((material, i) => {
      const mesh = new Mesh(i === 0 ? this.fogGeometry : this.geometry, material)
      mesh.frustumCulled = false
      mesh.renderOrder = 20 + i // after the sky
      mesh.visible = false
      return mesh
    })
    this.meshes[1].onBeforeRender = (renderer) => this.fit(renderer)
  }

  /** `isHazy`: whether the air is drawn. */
  update({ weather, time }: WorldState, isHazy: boolean): void {
    const { rain, snow, wind } = weather ?? { rain: 0, snow: 0, wind: 0 }
    const [streaks, flakes, drops] = [STREAKS * rain, FLAKES * snow, DROPS * rain].map(Math.round)
    this.meshes[0].visible = isHazy && this.shared.head_count.value > 0
    this.meshes[1].visible = streaks + flakes > 0
    this.geometry.setDrawRange(0, 6 * (streaks + flakes + drops))
    this.own.seed.value = Math.floor(RATE * time)
    this.own.flakes.value = streaks
    this.own.drops.value = streaks + flakes
    this.wind = wind
    this.time = time
    this.shared.sun_place.value.w = (CLOUD_DRIFT * wind * time) % 1000
    this.shared.dawn.value.w = cloudsOf(weather)
  }

  /** Sets the view directions from a camera. */
  prepare(camera: Camera): void {
    this.mapFromClip.multiplyMatrices(camera.matrixWorld, camera.projectionMatrixInverse)
  }

  dispose(): void {
    this.geometry.dispose()
    this.fogGeometry.dispose()
    for (const material of this.materials) material.dispose()
  }

  /** Sets the size of a pixel of the image that is drawn. */
  private fit(renderer: WebGLRenderer): void {
    const target = renderer.getRenderTarget()
    const { x, y } = target ? size.set(target.width, target.height) : renderer.getDrawingBufferSize(size)
    const pixel = 2 * Math.max(1, y / 480)
    this.own.shape.value.set(pixel / x, pixel / y, 0.1 + 0.9 * this.wind, this.time)
    this.materials[1].uniformsNeedUpdate = true
  }
}

/** Two triangles for each cell of a grid, whose vertices are in rows. */
function grid(columns: number, rows: number): number[] {
  const indices: number[] = []
  for (let row = 0; row < rows; row++)
    for (let column = 0; column < columns; column++) {
      const first = row * (columns + 1) + column
      indices.push(first, first + 1, first + columns + 2, first, first + columns + 2, first + columns + 1)
    }
  return indices
}

const size = new Vector2()
