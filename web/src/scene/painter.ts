// The WebGL context: shadow maps, then the picture, smoothed where the profile asks for it.
import { BufferAttribute, BufferGeometry, Color, GLSL3, LinearFilter, Mesh, NoToneMapping } from 'three'
import { OrthographicCamera, ShaderMaterial, Vector3, WebGLRenderer, WebGLRenderTarget } from 'three'
import type { PerspectiveCamera } from 'three'

import type { Moment } from './motion'
import { isSoftware, type Profile } from './quality'
import type { World } from './world'

const COPY_VERTEX = 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }'
const COPY_FRAGMENT = /* glsl */ `
uniform sampler2D drawn;
out vec4 pixel;
void main() { pixel = vec4(texelFetch(drawn, ivec2(gl_FragCoord.xy), 0).rgb, 1.0); }
`

export class Painter {
  /** Pixels of the picture for one of the page. */
  ratio = 1
  calls = 0
  triangles = 0
  readonly renderer: string
  readonly isSoftware: boolean
  private smooth: WebGLRenderTarget | null = null
  private readonly sheet = new BufferGeometry()
  private readonly copy = new ShaderMaterial({
    ...{ vertexShader: COPY_VERTEX, fragmentShader: COPY_FRAGMENT, glslVersion: GLSL3 },
    ...{ uniforms: { drawn: { value: null } }, depthTest: false, depthWrite: false },
  })
  private readonly page: Mesh
  private readonly flat = new OrthographicCamera()
  private readonly eye = new Vector3()

  /** For that canvas; null if the browser has no WebGL 2. */
  static on(canvas: HTMLCanvasElement): Painter | null {
    try {
      const powerPreference = 'high-performance'
      return new Painter(new WebGLRenderer({ canvas, antialias: false, alpha: false, powerPreference }))
    } catch {
      return null
    }
  }

  private constructor(private readonly gl: WebGLRenderer) {
    gl.toneMapping = NoToneMapping // the shaders do it
    gl.autoClear = false
    gl.info.autoReset = false
    gl.setClearColor(new Color(0, 0, 0), 1)
    const context = gl.getContext()
    const words = context.getExtension('WEBGL_debug_renderer_info')
    this.renderer = String(context.getParameter(words ? words.UNMASKED_RENDERER_WEBGL : context.RENDERER))
    this.isSoftware = isSoftware(this.renderer)
    this.sheet.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3))
    this.page = new Mesh(this.sheet, this.copy)
    this.page.frustumCulled = false
  }

  /** Of the page [pixels], drawn as that profile says. */
  resize(width: number, height: number, profile: Profile): void {
    this.ratio = Math.min(window.devicePixelRatio, profile.pixelRatio)
    this.gl.setPixelRatio(this.ratio)
    this.gl.setSize(width, height, false)
    this.smooth?.dispose()
    this.smooth = null
    if (profile.samples === 0) return
    const { width: columns, height: rows } = this.gl.domElement
    const look = { minFilter: LinearFilter, magFilter: LinearFilter, samples: profile.samples, generateMipmaps: false }
    this.smooth = new WebGLRenderTarget(columns, rows, look)
  }

  /** Draws the world at that moment. */
  paint(world: World, camera: PerspectiveCamera, moment: Moment, watched: string, dt: number): void {
    const { gl, smooth } = this
    if (gl.getContext().isContextLost()) return
    gl.info.reset()
    this.eye.copy(camera.position)
    world.update(moment, watched, this.eye, dt)
    world.drawShadows(gl, this.eye, watched)
    world.prepare(camera)
    gl.setRenderTarget(smooth)
    gl.clear()
    gl.render(world.stage, camera)
    if (smooth) {
      gl.setRenderTarget(null)
      this.copy.uniforms.drawn.value = smooth.texture
      gl.render(this.page, this.flat)
    }
    this.calls = gl.info.render.calls
    this.triangles = gl.info.render.triangles
  }

  dispose(): void {
    this.smooth?.dispose()
    this.sheet.dispose()
    this.copy.dispose()
    this.gl.dispose()
  }
}
