// The LIDAR's scan of the watched vehicle in the scene: points where its rays ended, and a faint fan.
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  DynamicDrawUsage,
  GLSL3,
  Group,
  Mesh,
  Points,
  Quaternion,
  ShaderMaterial,
  Vector3,
} from 'three'

import type { LidarScan, Pose } from '../messages'
import { quaternion, type Motion, type Placed } from './motion'

const COLOR = 'vec3(0.30, 0.86, 1.0)'
/** Of a point on the screen [pixels of the page]. */
const SIZE = 5

const VERTEX = /* glsl */ `
uniform float size;
void main() {
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
  gl_Position.z -= 0.0004 * gl_Position.w;  // in front of what it lies on
  gl_PointSize = size;
}
`
const FRAGMENT = /* glsl */ `
out vec4 pixel;
void main() {
  float far = length(gl_PointCoord - 0.5) * 2.0;
  if (far > 1.0) discard;
  pixel = vec4(${COLOR}, smoothstep(1.0, 0.6, far));
}
`
const VEIL = /* glsl */ `
out vec4 pixel;
void main() { pixel = vec4(${COLOR}, 0.06); }
`

export class ScanView {
  readonly group = new Group()
  private readonly points = new BufferGeometry()
  private readonly fan = new BufferGeometry()
  private readonly dot = new ShaderMaterial({
    ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms: { size: { value: SIZE } } },
    ...{ transparent: true, depthWrite: false },
  })
  private readonly veil = new ShaderMaterial({
    ...{ vertexShader: VERTEX, fragmentShader: VEIL, glslVersion: GLSL3, uniforms: { size: { value: 1 } } },
    ...{ transparent: true, depthWrite: false, side: DoubleSide },
  })
  private drawn: LidarScan | null = null

  constructor() {
    for (const [thing, order] of [
      [new Mesh(this.fan, this.veil), 20],
      [new Points(this.points, this.dot), 21],
    ] as const) {
      thing.frustumCulled = false
      thing.renderOrder = order
      this.group.add(thing)
    }
  }

  set pixelRatio(ratio: number) {
    this.dot.uniforms.size.value = Math.max(SIZE * ratio, 2)
  }

  /** Draws that scan of the vehicle from where its sensor, at `mount` in vehicle axes, was. */
  show(scan: LidarScan | null, vehicle: string, mount: Pose | null, motion: Motion): void {
    this.group.visible = false
    if (!scan || !mount) return
    this.group.visible = true
    if (scan === this.drawn) return
    const begin = motion.poseAt(vehicle, scan.time - scan.scan_time * (scan.time_increment > 0 ? 1 : 0), first)
    const end = motion.poseAt(vehicle, scan.time, last)
    if (!begin || !end) return
    this.drawn = scan
    this.lay(scan, mount, begin, end)
  }

  /** Forgets the scan. */
  clear(): void {
    this.drawn = null
    this.group.visible = false
  }

  private lay(scan: LidarScan, mount: Pose, begin: Placed, end: Placed): void {
    const n = scan.ranges.length
    const points = attribute(this.points, n)
    const fan = attribute(this.fan, 3 * n)
    const [mx, my, mz] = mount.position
    quaternion(mount, turn)
    let hits = 0
    let corners = 0
    let isOpen = false
    for (let i = 0; i < n; i++) {
      const range = scan.ranges[i]
      const f = n > 1 ? i / (n - 1) : 1
      const angle = scan.angle_min + i * scan.angle_increment
      pose.position.lerpVectors(begin.position, end.position, f)
      pose.orientation.copy(begin.orientation).slerp(end.orientation, f)
      center.set(mx, my, mz).applyQuaternion(pose.orientation).add(pose.position)
      if (!Number.isFinite(range)) {
        isOpen = false
        continue
      }
      hit.set(range * Math.cos(angle), range * Math.sin(angle), 0).applyQuaternion(turn)
      hit.applyQuaternion(pose.orientation).add(center)
      if (isOpen) {
        fan.setXYZ(corners++, center.x, center.y, center.z)
        fan.setXYZ(corners++, points.getX(hits - 1), points.getY(hits - 1), points.getZ(hits - 1))
        fan.setXYZ(corners++, hit.x, hit.y, hit.z)
      }
      points.setXYZ(hits++, hit.x, hit.y, hit.z)
      isOpen = true
    }
    this.points.setDrawRange(0, hits)
    this.fan.setDrawRange(0, corners)
    points.needsUpdate = fan.needsUpdate = true
  }

  dispose(): void {
    for (const part of [this.points, this.fan, this.dot, this.veil]) part.dispose()
  }
}

/** The geometry's positions, with room for so many. */
function attribute(geometry: BufferGeometry, count: number): BufferAttribute {
  const known = geometry.getAttribute('position') as BufferAttribute | undefined
  if (known && known.count >= count) return known
  geometry.dispose()
  const made = new BufferAttribute(new Float32Array(3 * count), 3)
  made.setUsage(DynamicDrawUsage)
  geometry.setAttribute('position', made)
  return made
}

const first: Placed = { position: new Vector3(), orientation: new Quaternion() }
const last: Placed = { position: new Vector3(), orientation: new Quaternion() }
const pose: Placed = { position: new Vector3(), orientation: new Quaternion() }
const turn = new Quaternion()
const center = new Vector3()
const hit = new Vector3()
