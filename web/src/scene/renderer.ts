// Renders the world with WebGL: shadow maps first, then the image, with MSAA if the profile uses it.

import type { PerspectiveCamera } from 'three'
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  GLSL3,
  LinearFilter,
  Mesh,
  NoToneMapping,
  OrthographicCamera,
  ShaderMaterial,
  Vector3,
  WebGLRenderer,
  WebGLRenderTarget,
} from 'three'

import type { WorldState } from './motion'
import { isSoftware, type Profile } from './quality'
import type { World } from './world'

const COPY_VERTEX = 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }'
const COPY_FRAGMENT = /* glsl */ `
uniform sampler2D drawn;
out vec4 pixel;
void main() { pixel = vec4(texelFetch(drawn, ivec2(gl_FragCoord.xy), 0).rgb, 1.0); }
`

export class Renderer {
  /** Image pixels per CSS pixel. */
  ratio = 1
  calls = 0
  triangles = 0
  readonly driver: string
  readonly isSoftware: boolean
  private target: WebGLRenderTarget | null = null
  private readonly triangle = new BufferGeometry()
  private readonly copy = new ShaderMaterial({
    ...{ vertexShader: COPY_VERTEX, fragmentShader: COPY_FRAGMENT, glslVersion: GLSL3 },
    ...{ uniforms: { drawn: { value: null } }, depthTest: false, depthWrite: false },
  })
  private readonly quad: Mesh
  private readonly flatCamera = new OrthographicCamera()
  private readonly cameraPosition = new Vector3()

  /** A renderer for a canvas; null if the browser has no WebGL 2. */
  static create(canvas: HTMLCanvasElement): Renderer | null {
    try {
      const powerPreference = 'high-performance'
      return new Renderer(new WebGLRenderer({ canvas, antialias: false, alpha: false, powerPreference }))
    } catch {
      return null
    }
  }

  private constructor(private readonly gl: WebGLRenderer) {
    gl.toneMapping = NoToneMapping // done by the shaders
    gl.autoClear = false
    gl.info.autoReset = false
    gl.setClearColor(new Color(0, 0, 0), 1)
    const context = gl.getContext()
    const info = context.getExtension('WEBGL_debug_renderer_info')
    this.driver = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER))
    this.isSoftware = isSoftware(this.driver)
    this.triangle.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3))
    this.quad = new Mesh(this.triangle, this.copy)
    this.quad.frustumCulled = false
  }

  /** Sets the size [CSS pixels] and the profile. */
  resize(width: number, height: number, profile: Profile): void {
    this.ratio = Math.min(window.devicePixelRatio, profile.pixelRatio)
    this.gl.setPixelRatio(this.ratio)
    this.gl.setSize(width, height, false)
    this.target?.dispose()
    this.target = null
    if (profile.samples === 0) return
    const { width: columns, height: rows } = this.gl.domElement
    const options = {
      minFilter: LinearFilter,
      magFilter: LinearFilter,
      samples: profile.samples,
      generateMipmaps: false,
    }
    this.target = new WebGLRenderTarget(columns, rows, options)
  }

  /** Draws one image of the world. */
  render(world: World, camera: PerspectiveCamera, state: WorldState, followed: string, dt: number): void {
    const { gl, target } = this
    if (gl.getContext().isContextLost()) return
    gl.info.reset()
    this.cameraPosition.copy(camera.position)
    world.update(state, followed, this.cameraPosition, dt)
    world.drawShadows(gl, this.cameraPosition, followed)
    world.prepare(camera)
    gl.setRenderTarget(target)
    gl.clear()
    gl.render(world.scene, camera)
    if (target) {
      gl.setRenderTarget(null)
      this.copy.uniforms.drawn.value = target.texture
      gl.render(this.quad, this.flatCamera)
    }
    this.calls = gl.info.render.calls
    this.triangles = gl.info.render.triangles
  }

  dispose(): void {
    this.target?.dispose()
    this.triangle.dispose()
    this.copy.dispose()
    this.gl.dispose()
  }
}
