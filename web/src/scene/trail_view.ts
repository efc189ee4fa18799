// The driven lines of all vehicles as ribbons on the ground, in one draw call.
import { BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, GLSL3, Mesh, ShaderMaterial } from 'three'

import type { Scene } from '../messages'
import { TRAIL_POINTS, type Trail, type Trails } from '../trails'
import { vehicleColour } from '../vehicle_colours'

/** Half the width of a ribbon [m]. */
const HALF_WIDTH = 0.008
/** Brightness at night, relative to day. */
const NIGHT_BRIGHTNESS = 0.6
/** Corners of a segment, and numbers in a corner. */
const CORNERS = 6

const VERTEX = /* glsl */ `
in vec3 color;
out vec3 shade;
void main() {
  shade = color;
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
  gl_Position.z -= 0.0006 * gl_Position.w;  // in front of the ground it lies on
}
`
const FRAGMENT = /* glsl */ `
uniform float brightness;
in vec3 shade;
out vec4 pixel;
void main() { pixel = vec4(shade * brightness, 0.85); }
`

/** What was drawn of a trail. */
interface Drawn {
  trail: Trail
  colour: Color
  /** First segment in the geometry, number of points that are in it, and version of the trail. */
  first: number
  points: number
  version: number
}

export class TrailView {
  readonly mesh: Mesh
  private readonly geometry = new BufferGeometry()
  private readonly material = new ShaderMaterial({
    ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms: { brightness: { value: 1 } } },
    ...{ transparent: true, depthWrite: false },
  })
  private drawn = new Map<string, Drawn>()

  constructor() {
    this.mesh = new Mesh(this.geometry, this.material)
    this.mesh.frustumCulled = false
    this.mesh.renderOrder = 12
    this.mesh.visible = false
  }

  /** Shows the trails of the vehicles of a scene; only new points are written. */
  update(scene: Scene, trails: Trails, isShown: boolean, isDay: boolean): void {
    this.mesh.visible = isShown
    if (!isShown) return
    this.material.uniforms.brightness.value = isDay ? 1 : NIGHT_BRIGHTNESS
    if (
      trails.all.size !== this.drawn.size ||
      [...trails.all].some(([name, trail]) => this.drawn.get(name)?.trail !== trail)
    )
      this.allocate(scene, trails)
    for (const drawn of this.drawn.values()) this.extend(drawn)
  }

  dispose(): void {
    this.geometry.dispose()
    this.material.dispose()
  }

  private allocate(scene: Scene, trails: Trails): void {
    const count = CORNERS * TRAIL_POINTS * trails.all.size
    this.geometry.dispose()
    for (const name of ['position', 'color']) {
      const attribute = new BufferAttribute(new Float32Array(3 * count), 3)
      attribute.setUsage(DynamicDrawUsage)
      this.geometry.setAttribute(name, attribute)
    }
    this.drawn = new Map(
      [...trails.all].map(([name, trail], i) => [
        name,
        {
          ...{ trail, colour: new Color(vehicleColour(scene, name)).convertLinearToSRGB() },
          ...{ first: i * TRAIL_POINTS, points: 0, version: trail.version },
        },
      ]),
    )
  }

  /** Writes the segments to the points that are new; segments that are not used have no area. */
  private extend(drawn: Drawn): void {
    const { trail, colour, first } = drawn
    if (drawn.points === trail.length && drawn.version === trail.version) return
    const position = this.geometry.getAttribute('position') as BufferAttribute
    const color = this.geometry.getAttribute('color') as BufferAttribute
    const begin = 3 * CORNERS * first
    const size = 3 * CORNERS * TRAIL_POINTS
    if (drawn.version !== trail.version) {
      position.array.fill(0, begin, begin + size)
      position.addUpdateRange(begin, size)
      drawn.points = 0
      drawn.version = trail.version
    }
    const start = Math.max(1, drawn.points)
    for (let i = start; i < trail.length; i++) {
      const at = CORNERS * (first + i)
      writeSegment(trail.points, i, position, at)
      for (let corner = 0; corner < CORNERS; corner++) color.setXYZ(at + corner, colour.r, colour.g, colour.b)
    }
    drawn.points = trail.length
    const from = 3 * CORNERS * (first + start)
    const written = 3 * CORNERS * Math.max(0, trail.length - start)
    for (const attribute of [position, color]) {
      attribute.addUpdateRange(from, written)
      attribute.needsUpdate = true
    }
  }
}

/** Two triangles from point i - 1 to point i; without area next to a jump. Its corners meet those of its neighbours. */
function writeSegment(points: Float32Array, i: number, into: BufferAttribute, at: number): void {
  const [a, b] = [3 * (i - 1), 3 * i]
  const [dx, dy] = [points[b] - points[a], points[b + 1] - points[a + 1]]
  const scale = HALF_WIDTH / Math.hypot(dx, dy)
  if (!Number.isFinite(scale)) return // the corners stay in one point
  const [nx, ny] = [-dy * scale, dx * scale]
  // the direction of the previous segment, so that there is no gap in a bend
  const [ex, ey] = i > 1 ? [points[a] - points[a - 3], points[a + 1] - points[a - 2]] : [NaN, NaN]
  const before = HALF_WIDTH / Math.hypot(ex, ey)
  const isJoined = (ex * dx + ey * dy) * before * scale > 0.8 * HALF_WIDTH ** 2
  const [px, py] = isJoined ? [-ey * before, ex * before] : [nx, ny]
  const corner = (n: number, from: number, x: number, y: number) =>
    into.setXYZ(at + n, points[from] + x, points[from + 1] + y, points[from + 2])
  corner(0, a, px, py)
  corner(1, a, -px, -py)
  corner(2, b, nx, ny)
  corner(3, b, nx, ny)
  corner(4, a, -px, -py)
  corner(5, b, -nx, -ny)
}
