// Renders the world with WebGL: shadow maps first, then the image, with MSAA or FXAA.

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
/**
 * FXAA: jagged edges are smoothed, with the formulas of render/fxaa.py (T. Lottes, 2009). Opacity 0 marks what is smooth,
 * such as texts.
 */
const COPY_FRAGMENT = /* glsl */ `
uniform sampler2D drawn;
out vec4 pixel;
#ifdef FXAA
vec3 at(vec2 off) {
  vec2 size = vec2(textureSize(drawn, 0));
  return texture(drawn, (gl_FragCoord.xy + off) / size).rgb;
}
float brightness(vec3 c) { return dot(c, vec3(0.299, 0.587, 0.114)); }
void main() {
  vec4 drawn_here = texelFetch(drawn, ivec2(gl_FragCoord.xy), 0);
  vec3 own = drawn_here.rgb;
  float m = brightness(own), nw = brightness(at(vec2(-1.0, 1.0))), ne = brightness(at(vec2(1.0, 1.0)));
  float sw = brightness(at(vec2(-1.0, -1.0))), se = brightness(at(vec2(1.0, -1.0)));
  float low = min(m, min(min(nw, ne), min(sw, se))), high = max(m, max(max(nw, ne), max(sw, se)));
  pixel = vec4(own, 1.0);
  if (high - low < max(0.03, 0.125 * high)) return;
  vec2 along = vec2(nw + ne - sw - se, nw + sw - ne - se);  // across the gradient
  float scale = min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) * 0.03125, 0.0078);
  along = clamp(along / scale, -8.0, 8.0);
  vec3 near = 0.5 * (at(along / -6.0) + at(along / 6.0));
  vec3 wide = 0.5 * near + 0.25 * (at(-0.5 * along) + at(0.5 * along));
  float b = brightness(wide);
  pixel = vec4(mix(own, b < low || b > high ? near : wide, drawn_here.a), 1.0);
}
#else
void main() { pixel = vec4(texelFetch(drawn, ivec2(gl_FragCoord.xy), 0).rgb, 1.0); }
#endif
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
  /** Passed by the graphics commands when the latest image is complete; software rendering only. */
  private fence: WebGLSync | null = null

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
    gl.domElement.addEventListener('webglcontextlost', () => (this.fence = null)) // it is lost, too
    const context = gl.getContext()
    const info = context.getExtension('WEBGL_debug_renderer_info')
    this.driver = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER))
    this.isSoftware = isSoftware(this.driver)
    this.triangle.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3))
    this.quad = new Mesh(this.triangle, this.copy)
    this.quad.frustumCulled = false
  }

  /**
   * Whether the latest image is still being drawn. Software rendering needs up to a second for an image; without waiting
   * the browser queues several images, and each click on the page is shown after all of them.
   */
  get isBusy(): boolean {
    if (!this.fence) return false
    const context = this.gl.getContext() as WebGL2RenderingContext
    if (context.getSyncParameter(this.fence, context.SYNC_STATUS) === context.UNSIGNALED) return true
    context.deleteSync(this.fence)
    this.fence = null
    return false
  }

  /** Sets the size [CSS pixels] and the profile. */
  resize(width: number, height: number, profile: Profile): void {
    this.ratio = Math.min(window.devicePixelRatio, profile.pixelRatio)
    this.gl.setPixelRatio(this.ratio)
    this.gl.setSize(width, height, false)
    this.target?.dispose()
    this.copy.defines = profile.samples === 0 ? { FXAA: 1 } : {}
    this.copy.needsUpdate = true
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
    const context = gl.getContext() as WebGL2RenderingContext
    if (context.isContextLost()) return
    gl.info.reset()
    this.cameraPosition.copy(camera.position)
    world.update(state, followed, this.cameraPosition, dt)
    world.drawShadows(gl, camera, followed)
    const { width, height } = target ?? gl.domElement
    world.prepare(gl, camera, width, height)
    gl.setRenderTarget(target)
    gl.clear()
    gl.render(world.scene, camera)
    if (target) {
      gl.setRenderTarget(null)
      this.copy.uniforms.drawn.value = target.texture
      gl.render(this.quad, this.flatCamera)
    }
    if (this.isSoftware) {
      this.fence = context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0)
      context.flush()
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
