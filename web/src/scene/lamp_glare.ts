// Glare around lamps that are on and face the camera.
import {
  AdditiveBlending,
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  GLSL3,
  Points,
  ShaderMaterial,
  Vector3,
} from 'three'

import { LAMPS } from './lamps'
import type { Lens } from './lenses'
import type { VehicleModel } from './vehicle'

/** Diameter of the glare of a headlight and of another lamp [m]. */
const HEADLIGHT_SIZE = 0.16
const LAMP_SIZE = 0.07
/** Brightness of the glare of a lens of a traffic light at night: a brighter one would change its hue. */
const LENS_BRIGHTNESS = 0.5
/** Diameter of this glare [m]. */
const LENS_SIZE = 0.05
/** Brightness of the glare by day, relative to night. */
const DAY_BRIGHTNESS = 0.3

const VERTEX = /* glsl */ `
in vec4 aim;    // direction, cosine of the outer cone
in vec4 color;  // colour, diameter [m]
uniform float height;  // of the image [pixels]
out vec3 glare;
void main() {
  vec3 to = normalize(cameraPosition - position);
  float facing = clamp(dot(to, aim.xyz) * 1.1 - 0.1, 0.0, 1.0);
  glare = color.rgb * facing * facing;
  vec3 place = position + to * 0.012;  // in front of the lamp
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
  gl_PointSize = min(color.w * projectionMatrix[1][1] * height * 0.5 / gl_Position.w, 400.0);
}
`
const FRAGMENT = /* glsl */ `
in vec3 glare;
out vec4 pixel;
void main() {
  float far = min(length(gl_PointCoord - 0.5) * 2.0, 1.0);
  float core = exp(-far * far * 60.0), veil = (1.0 - far) * (1.0 - far) * 0.22;
  pixel = vec4(glare * (core * 0.8 + veil), 1.0);
}
`

export class LampGlare {
  readonly points: Points
  private readonly geometry = new BufferGeometry()
  private readonly material: ShaderMaterial

  constructor(vehicles: number, lenses: number) {
    const lamps = Math.max(LAMPS.length * vehicles + lenses, 1)
    for (const [name, width] of [
      ['position', 3],
      ['aim', 4],
      ['color', 4],
    ] as const) {
      const attribute = new BufferAttribute(new Float32Array(width * lamps), width)
      attribute.setUsage(DynamicDrawUsage)
      this.geometry.setAttribute(name, attribute)
    }
    this.material = new ShaderMaterial({
      ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms: { height: { value: 1 } } },
      ...{ blending: AdditiveBlending, transparent: true, depthWrite: false },
    })
    this.points = new Points(this.geometry, this.material)
    this.points.frustumCulled = false
    this.points.renderOrder = 15
  }

  /** Height of the image [pixels]. */
  set height(pixels: number) {
    this.material.uniforms.height.value = pixels
  }

  update(vehicles: readonly VehicleModel[], lenses: readonly Lens[], dusk: number): void {
    const share = DAY_BRIGHTNESS + dusk * (1 - DAY_BRIGHTNESS)
    const position = this.geometry.getAttribute('position') as BufferAttribute
    const aim = this.geometry.getAttribute('aim') as BufferAttribute
    const color = this.geometry.getAttribute('color') as BufferAttribute
    let slot = 0
    for (const { root, lamps, levels } of vehicles) {
      lamps.forEach((lamp, i) => {
        if (levels[i] === 0) return
        point.copy(lamp.position).applyMatrix4(root)
        position.setXYZ(slot, point.x, point.y, point.z)
        point.copy(lamp.aim).transformDirection(root)
        aim.setXYZW(slot, point.x, point.y, point.z, lamp.cosOuter)
        point.copy(lamp.color).divideScalar(Math.max(lamp.color.x, lamp.color.y, lamp.color.z))
        point.multiplyScalar(levels[i] * share)
        color.setXYZW(slot++, point.x, point.y, point.z, lamp.isHeadlight ? HEADLIGHT_SIZE : LAMP_SIZE)
      })
    }
    for (const lens of lenses) {
      if (!lens.mesh.visible) continue
      position.setXYZ(slot, ...lens.position.toArray())
      aim.setXYZW(slot, ...lens.aim.toArray(), 0)
      point.copy(lens.color).divideScalar(Math.max(...lens.color.toArray()))
      point.multiplyScalar(Math.max(DAY_BRIGHTNESS, LENS_BRIGHTNESS * share))
      color.setXYZW(slot++, ...point.toArray(), LENS_SIZE)
    }
    this.geometry.setDrawRange(0, slot)
    this.points.visible = slot > 0
    position.needsUpdate = aim.needsUpdate = color.needsUpdate = true
  }

  dispose(): void {
    this.geometry.dispose()
    this.material.dispose()
  }
}

const point = new Vector3()
