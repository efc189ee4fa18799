// Points, lines and texts in the scene, in one draw call.
import {
  BufferAttribute,
  type BufferGeometry,
  type Camera,
  CanvasTexture,
  CustomBlending,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  OneMinusSrcAlphaFactor,
  ShaderMaterial,
  SrcAlphaFactor,
  Vector2,
  Vector3,
  type WebGLRenderer,
  ZeroFactor,
} from 'three'

import FRAGMENT from '../../../src/autodrive/graphics/render/shaders/strokes.frag?raw'
import VERTEX from '../../../src/autodrive/graphics/render/shaders/strokes.vert?raw'

/** Columns and rows of the image with the characters, as in the shader, and size of one [pixels]; characters beyond them are squares. */
const [COLUMNS, ROWS, WIDTH, HEIGHT] = [32, 16, 32, 64]
const OUTLINE = 8
/** Least height of a text that is also seen behind other things [pixels]. */
const LEAST = 12
const [POINT, LINE, CHARACTER] = [0, 1, 2]
const NO_CHARACTER = '\u25a1'

/** Instances of a quad; they are placed by the matrix of `mesh`. */
export class Strokes {
  readonly mesh: Mesh
  private readonly geometry = new InstancedBufferGeometry()
  private all: readonly Primitive[] = []
  private readonly uniforms = {
    image: { value: new Vector2(1, 1) },
    characters: { value: characters().texture },
    least: { value: 0 },
  }
  private readonly material = new ShaderMaterial({
    ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms: this.uniforms },
    ...{ transparent: true, depthWrite: false },
    // their edges are smooth: where they cover the image, FXAA leaves it as it is
    ...{ blending: CustomBlending, blendSrc: SrcAlphaFactor, blendDst: OneMinusSrcAlphaFactor },
    ...{ blendSrcAlpha: ZeroFactor, blendDstAlpha: OneMinusSrcAlphaFactor },
  })

  /** `isSeenThrough`: also what is behind other things is shown. */
  constructor(isSeenThrough = false) {
    const corners = new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0])
    this.geometry.setAttribute('position', new BufferAttribute(corners, 3))
    this.geometry.setIndex([0, 1, 2, 0, 2, 3])
    this.material.depthTest = !isSeenThrough
    this.uniforms.least.value = isSeenThrough ? LEAST : 0
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
    this.all = all
  }

  /** Moves texts up in the image until none covers another one below it, as `spread` of render/strokes.py. */
  spread(camera: Camera): void {
    this.mesh.updateMatrixWorld()
    camera.updateMatrixWorld()
    const texts = []
    const least = (2 * this.uniforms.least.value) / (camera.projectionMatrix.elements[5] * this.uniforms.image.value.y)
    for (let first = 0, count = 1; first < this.all.length; first += count) {
      const { begin, shape } = this.all[first]
      const [kind, size, place] = shape
      count = kind === CHARACTER ? Math.round(1 - 2 * place) : 1 // the first of n letters is at -(n - 1) / 2
      const { x, y, z } = seen
        .fromArray([...begin])
        .applyMatrix4(this.mesh.matrixWorld)
        .applyMatrix4(camera.matrixWorldInverse)
      const height = Math.max(size, least * -z)
      const box = { x: x / -z, y: y / -z, wide: (0.25 * count * height) / -z, high: (0.5 * height) / -z }
      if (kind === CHARACTER && z < 0) texts.push({ first, count, box })
    }
    if (texts.length === 0) return
    const up = raised(texts.map(({ box }) => box))
    const ends = this.geometry.getAttribute('end')
    for (const [i, { first, count }] of texts.entries()) for (let k = first; k < first + count; k++) ends.setY(k, up[i])
    ends.needsUpdate = true
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
    return { begin: at, end: [0, 0, 0], tint, shape }
  })
}

/** How far each text is moved up until it covers none below it, in its own heights; half sizes in an image. */
export function raised(texts: readonly { x: number; y: number; wide: number; high: number }[]): number[] {
  const placed: { x: number; y: number; wide: number; high: number }[] = []
  const up = texts.map(() => 0)
  for (const i of [...up.keys()].sort((a, b) => texts[a].y - texts[b].y)) {
    const own = { ...texts[i] }
    const isHit = (one: typeof own) =>
      Math.abs(one.x - own.x) < one.wide + own.wide - 1e-9 && Math.abs(one.y - own.y) < one.high + own.high - 1e-9
    for (let hit = placed.find(isHit); hit; hit = placed.find(isHit)) own.y = hit.y + hit.high + own.high
    up[i] = (0.5 * (own.y - texts[i].y)) / own.high
    placed.push(own)
  }
  return up
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
      // a dark outline: texts are also read before a bright sky, and on snow
      this.context.lineJoin = 'round'
      this.context.lineWidth = OUTLINE
      this.context.strokeText(letter, x + WIDTH / 2, y + HEIGHT / 2, WIDTH)
      this.context.fillText(letter, x + WIDTH / 2, y + HEIGHT / 2, WIDTH)
      this.context.restore()
    }
    this.texture.needsUpdate = true
    return number
  }
}

const seen = new Vector3()
let known: Characters | null = null

/** The characters of all texts of the page. */
function characters(): Characters {
  known ??= new Characters()
  return known
}
