// Points, lines and texts in the scene, in one draw call.
import {
  BufferAttribute,
  type BufferGeometry,
  CanvasTexture,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
  Vector2,
  type WebGLRenderer,
} from 'three'

/** Least width of a line and diameter of a point [pixels]. */
const LEAST = 2
/** Columns and rows of the image with the characters, and size of one [pixels]; characters beyond them are squares. */
const [COLUMNS, ROWS, WIDTH, HEIGHT] = [32, 16, 32, 64]
const [POINT, LINE, CHARACTER] = [0, 1, 2]
const NO_CHARACTER = '\u25a1'

const VERTEX = /* glsl */ `
in vec3 begin;
in vec3 end;
in vec4 tint;
in vec4 shape;  // kind, size [m], place in the text, number of the character
uniform vec2 image;
out vec4 shade;
out vec2 place;
flat out float kind;
void main() {
  shade = tint;
  kind = shape.x;
  place = position.xy;
  vec3 a = (modelViewMatrix * vec4(begin, 1.0)).xyz;
  vec3 b = (modelViewMatrix * vec4(end, 1.0)).xyz;
  float near = -0.01;
  if (kind == ${LINE}.0) {
    // the part in front of the camera
    if (a.z > near && b.z <= near) a = mix(b, a, (near - b.z) / (a.z - b.z));
    if (b.z > near && a.z <= near) b = mix(a, b, (near - a.z) / (b.z - a.z));
  }
  vec3 seen = position.x > 0.0 ? b : a;
  float pixel = 2.0 * max(-seen.z, 0.01) / (projectionMatrix[1][1] * image.y);
  float half_size = 0.5 * max(shape.y, kind == ${CHARACTER}.0 ? 0.0 : ${LEAST}.0 * pixel);
  vec2 offset = half_size * position.xy;
  if (kind == ${LINE}.0) {
    vec2 along = b.xy / max(-b.z, 0.01) - a.xy / max(-a.z, 0.01);
    along = dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
    offset = half_size * (position.x * along + position.y * vec2(-along.y, along.x));
  } else if (kind == ${CHARACTER}.0) {
    offset = half_size * vec2(0.5 * position.x + shape.z, position.y);
    float number = shape.w;
    place = vec2(mod(number, ${COLUMNS}.0), floor(number / ${COLUMNS}.0));
    place = (place + vec2(0.5 + 0.5 * position.x, 0.5 - 0.5 * position.y)) / vec2(${COLUMNS}.0, ${ROWS}.0);
  }
  gl_Position = projectionMatrix * vec4(seen.xy + offset, seen.z, 1.0);
  // in front of the ground that it lies on, also for a camera just above it
  vec3 ray = normalize((vec4(seen, 0.0) * viewMatrix).xyz);
  float lift = half_size / max(abs(ray.z), 0.1) + 0.004;
  vec4 lifted = projectionMatrix * vec4(seen * max(1.0 - lift / length(seen), 0.1), 1.0);
  gl_Position.z = lifted.z / lifted.w * gl_Position.w;
  if (seen.z > near) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
`
const FRAGMENT = /* glsl */ `
uniform sampler2D characters;
in vec4 shade;
in vec2 place;
flat in float kind;
out vec4 pixel;
void main() {
  float far = kind == ${POINT}.0 ? length(place) : abs(place.y);
  float cover = clamp((1.0 - far) / max(fwidth(far), 1e-4), 0.0, 1.0);
  if (kind == ${CHARACTER}.0) cover = texture(characters, place).a;
  pixel = vec4(shade.rgb, shade.a * cover);
  if (pixel.a < 0.01) discard;
}
`

/** Instances of a quad; they are placed by the matrix of `mesh`. */
export class Strokes {
  readonly mesh: Mesh
  private readonly geometry = new InstancedBufferGeometry()
  private readonly uniforms = { image: { value: new Vector2(1, 1) }, characters: { value: characters().texture } }
  private readonly material = new ShaderMaterial({
    ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms: this.uniforms },
    ...{ transparent: true, depthWrite: false },
  })

  /** `isSeenThrough`: also what is behind other things is shown. */
  constructor(isSeenThrough = false) {
    const corners = new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0])
    this.geometry.setAttribute('position', new BufferAttribute(corners, 3))
    this.geometry.setIndex([0, 1, 2, 0, 2, 3])
    this.material.depthTest = !isSeenThrough
    this.mesh = new Mesh(this.geometry as BufferGeometry, this.material)
    this.mesh.frustumCulled = false
    this.mesh.renderOrder = isSeenThrough ? 22 : 13
    this.mesh.visible = false
    this.mesh.onBeforeRender = (renderer) => this.fit(renderer)
  }

  /** How many are drawn. */
  get count(): number {
    return this.geometry.instanceCount
  }

  /** Draws these instead of those before. */
  fill(all: readonly Primitive[]): void {
    this.geometry.dispose() // the attributes have other lengths
    for (const [name, size] of [
      ['begin', 3],
      ['end', 3],
      ['tint', 4],
      ['shape', 4],
    ] as const) {
      const values = new Float32Array(size * all.length)
      for (const [i, one] of all.entries()) values.set(one[name], size * i)
      this.geometry.setAttribute(name, new InstancedBufferAttribute(values, size))
    }
    this.geometry.instanceCount = all.length
  }

  dispose(): void {
    this.geometry.dispose()
    this.material.dispose()
  }

  /** Sets the size of the image that is drawn. */
  private fit(renderer: WebGLRenderer): void {
    renderer.getDrawingBufferSize(this.uniforms.image.value)
    this.material.uniformsNeedUpdate = true
  }
}

/** A point with its diameter [m]. */
export function dot(at: Place, tint: Tint, size: number): Primitive {
  return { begin: at, end: at, tint, shape: [POINT, size, 0, 0] }
}

/** A line with its width [m]. */
export function line(begin: Place, end: Place, tint: Tint, size: number): Primitive {
  return { begin, end, tint, shape: [LINE, size, 0, 0] }
}

/** The characters of a text with its middle at a place; `size`: its height [m]. */
export function letters(text: string, at: Place, tint: Tint, size: number): Primitive[] {
  const all = [...text]
  return all.map((letter, i) => {
    const shape = [CHARACTER, size, i - 0.5 * (all.length - 1), characters().number(letter)]
    return { begin: at, end: at, tint, shape }
  })
}

export type Place = readonly number[]
/** Red, green, blue and opacity, 0 to 1. */
export type Tint = readonly number[]

/** What is drawn with one quad: points of the map [m], a colour, and the numbers of its kind. */
export interface Primitive {
  begin: Place
  end: Place
  tint: Tint
  shape: Place
}

/** An image of the characters that were used. */
class Characters {
  readonly texture: CanvasTexture
  private readonly numbers = new Map<string, number>()
  private readonly context: CanvasRenderingContext2D | null

  constructor() {
    const canvas = document.createElement('canvas')
    ;[canvas.width, canvas.height] = [COLUMNS * WIDTH, ROWS * HEIGHT]
    this.context = canvas.getContext('2d')
    this.texture = new CanvasTexture(canvas)
    this.texture.flipY = false
    this.number(NO_CHARACTER)
  }

  /** The number of a character in the image. */
  number(letter: string): number {
    const known = this.numbers.get(letter)
    if (known !== undefined) return known
    const number = this.numbers.size
    if (number >= COLUMNS * ROWS) return 0
    this.numbers.set(letter, number)
    if (this.context) {
      const [x, y] = [(number % COLUMNS) * WIDTH, Math.floor(number / COLUMNS) * HEIGHT]
      this.context.save()
      this.context.beginPath()
      this.context.rect(x, y, WIDTH, HEIGHT)
      this.context.clip()
      this.context.font = `600 ${0.8 * HEIGHT}px ui-monospace, monospace`
      this.context.textAlign = 'center'
      this.context.textBaseline = 'middle'
      this.context.fillStyle = '#fff'
      this.context.fillText(letter, x + WIDTH / 2, y + HEIGHT / 2, WIDTH)
      this.context.restore()
    }
    this.texture.needsUpdate = true
    return number
  }
}

let known: Characters | null = null

/** The characters of all texts of the page. */
function characters(): Characters {
  known ??= new Characters()
  return known
}
