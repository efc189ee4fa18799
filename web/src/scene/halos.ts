// The glare around lamps that burn and look at us.
import { AdditiveBlending, BufferAttribute, BufferGeometry, DynamicDrawUsage } from 'three'
import { GLSL3, Points, ShaderMaterial, Vector3 } from 'three'

import { LAMPS } from './lamps'
import type { VehicleModel } from './vehicle'

/** Of the glare of a headlight and of a small lamp [m]. */
const HEAD_SIZE = 0.16
const SMALL_SIZE = 0.07
/** By day little is left of it. */
const BY_DAY = 0.3

const VERTEX = /* glsl */ `
in vec4 aim;    // direction, cosine of the outer cone
in vec4 color;  // with the size [m]
uniform float height;  // of the picture, in pixels
out vec3 glare;
void main() {
  vec3 to = normalize(cameraPosition - position);
  float facing = clamp(dot(to, aim.xyz) * 1.1 - 0.1, 0.0, 1.0);
  glare = color.rgb * facing * facing;
  vec3 place = position + to * 0.012;  // out of the glass
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

export class Halos {
  readonly points: Points
  private readonly geometry = new BufferGeometry()
  private readonly material: ShaderMaterial

  constructor(vehicles: number) {
    for (const [name, width] of [['position', 3], ['aim', 4], ['color', 4]] as const) {
      const attribute = new BufferAttribute(new Float32Array(width * LAMPS.length * Math.max(vehicles, 1)), width)
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

  /** Height of the picture [pixels]. */
  set height(pixels: number) {
    this.material.uniforms.height.value = pixels
  }

  update(vehicles: readonly VehicleModel[], isDay: boolean): void {
    const position = this.geometry.getAttribute('position') as BufferAttribute
    const aim = this.geometry.getAttribute('aim') as BufferAttribute
    const color = this.geometry.getAttribute('color') as BufferAttribute
    let slot = 0
    for (const { root, lamps, levels } of vehicles) {
      lamps.forEach((lamp, i) => {
        if (levels[i] === 0) return
        point.copy(lamp.place).applyMatrix4(root)
        position.setXYZ(slot, point.x, point.y, point.z)
        point.copy(lamp.aim).transformDirection(root)
        aim.setXYZW(slot, point.x, point.y, point.z, lamp.cosOuter)
        point.copy(lamp.color).divideScalar(Math.max(lamp.color.x, lamp.color.y, lamp.color.z))
        point.multiplyScalar(levels[i] * (isDay ? BY_DAY : 1))
        color.setXYZW(slot++, point.x, point.y, point.z, lamp.isHeadlight ? HEAD_SIZE : SMALL_SIZE)
      })
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
