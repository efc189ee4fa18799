// The LIDAR scan of the selected vehicle in the scene: its points, coloured by range, and a transparent fan.
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

import type { LidarScan, Pose, VehicleScene } from '../messages'
import type { Observable } from '../observable'
import { niceStep } from '../panels/scales'
import { type MotionInterpolator, type PlacedObject, quaternion } from './motion'
import { TURBO } from './turbo'

const COLOR = 'vec3(0.30, 0.86, 1.0)'
/** Diameter of a point, and of its edge, which is light around a dark colour and dark around a light one [CSS pixels]. */
const SIZE = 5
const EDGE = 8
/** Distance by which a point is drawn nearer to the camera than it is [m]. */
const LIFT = 0.004

/** Part of the distance of the colours below which they are adapted to nearer points. */
const SHRINK = 0.35

const VERTEX = /* glsl */ `
uniform float size;
uniform float farthest;
uniform vec3 turbo[${TURBO.length}];
in float range;
out vec3 shade;
void main() {
  float step = clamp(range / farthest, 0.0, 1.0) * ${(TURBO.length - 1).toFixed(1)};
  int below = min(int(step), ${TURBO.length - 2});
  shade = mix(turbo[below], turbo[below + 1], step - float(below));
  vec3 seen = (viewMatrix * vec4(position, 1.0)).xyz;
  seen -= ${LIFT} * normalize(seen);  // in front of the surface it lies on
  gl_Position = projectionMatrix * vec4(seen, 1.0);
  gl_PointSize = size;
}
`
const FRAGMENT = /* glsl */ `
uniform bool is_edge;
in vec3 shade;
out vec4 pixel;
void main() {
  float far = length(gl_PointCoord - 0.5) * 2.0;
  if (far > 1.0) discard;
  float bright = dot(shade, vec3(0.299, 0.587, 0.114));
  vec3 edge = vec3(bright < 0.5 ? 0.92 : 0.06);
  pixel = vec4(is_edge ? edge : shade, (is_edge ? 0.8 : 1.0) * smoothstep(1.0, 0.6, far));
}
`
/** Radius within which the fan fades out [m]; a larger one would tint the whole image. */
const FAN_RADIUS = 0.9
const FAN_VERTEX = /* glsl */ `
out vec3 place;
void main() {
  place = position;
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
}
`
const FAN_FRAGMENT = /* glsl */ `
uniform vec3 center;
uniform float brightness;
in vec3 place;
out vec4 pixel;
void main() {
  float near = 1.0 - min(distance(place, center) / ${FAN_RADIUS.toFixed(3)}, 1.0);
  pixel = vec4(${COLOR}, 0.12 * near * near * brightness);
}
`
/** Brightness at night, relative to day. */
const NIGHT_BRIGHTNESS = 0.55

/** Where the LIDAR of a vehicle is. */
type LidarScene = Pick<VehicleScene, 'lidar' | 'is_lidar_level'>

export class ScanView {
  readonly group = new Group()
  private readonly points = new BufferGeometry()
  private readonly fan = new BufferGeometry()
  private readonly brightness = { value: 1 }
  private readonly center = new Vector3()
  private readonly range = { value: 1 }
  private readonly pointMaterial = this.material(false)
  private readonly edgeMaterial = this.material(true)
  private readonly fanMaterial = new ShaderMaterial({
    ...{ vertexShader: FAN_VERTEX, fragmentShader: FAN_FRAGMENT, glslVersion: GLSL3 },
    ...{ uniforms: { center: { value: this.center }, brightness: this.brightness } },
    ...{ transparent: true, depthWrite: false, side: DoubleSide },
  })
  private shown: LidarScan | null = null

  /** `farthest` [m] is set to the range at which the colours end. */
  constructor(private readonly farthest: Observable<number>) {
    for (const [thing, order] of [
      [new Mesh(this.fan, this.fanMaterial), 20],
      [new Points(this.points, this.edgeMaterial), 21], // all before the points, which may be close together
      [new Points(this.points, this.pointMaterial), 22],
    ] as const) {
      thing.frustumCulled = false
      thing.renderOrder = order
      this.group.add(thing)
    }
  }

  set pixelRatio(ratio: number) {
    this.pointMaterial.uniforms.size.value = Math.max(SIZE * ratio, 2)
    this.edgeMaterial.uniforms.size.value = Math.max(EDGE * ratio, 4)
  }

  private material(isEdge: boolean): ShaderMaterial {
    const size = { value: isEdge ? EDGE : SIZE }
    const uniforms = { size, is_edge: { value: isEdge }, farthest: this.range, turbo: { value: COLOURS } }
    return new ShaderMaterial({
      ...{ vertexShader: VERTEX, fragmentShader: FRAGMENT, glslVersion: GLSL3, uniforms },
      ...{ transparent: true, depthWrite: false },
    })
  }

  /** Shows a scan from the poses of the vehicle during the scan; `mount` is the sensor pose in the vehicle frame. */
  show(scan: LidarScan | null, vehicle: string, spec: LidarScene, motion: MotionInterpolator): void {
    this.brightness.value = motion.state.isDay ? 1 : NIGHT_BRIGHTNESS
    this.group.visible = false
    if (!scan || !spec.lidar) return
    this.group.visible = true
    if (scan === this.shown) return
    const begin = motion.poseAt(vehicle, scan.time - scan.scan_time * (scan.time_increment > 0 ? 1 : 0), first)
    const end = motion.poseAt(vehicle, scan.time, last)
    if (!begin || !end) return
    this.shown = scan
    this.update(scan, spec.lidar, spec.is_lidar_level, begin, end)
  }

  /** Removes the scan. */
  clear(): void {
    this.shown = null
    this.group.visible = false
  }

  private update(scan: LidarScan, mount: Pose, isLevel: boolean, begin: PlacedObject, end: PlacedObject): void {
    const n = scan.ranges.length
    const points = attribute(this.points, n)
    const ranges = attribute(this.points, n, 'range', 1)
    const fan = attribute(this.fan, 3 * n)
    this.fitColours(scan)
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
      hit.set(Math.cos(angle), Math.sin(angle), 0).applyQuaternion(turn).applyQuaternion(pose.orientation)
      if (isLevel) {
        ahead.set(1, 0, 0).applyQuaternion(turn).applyQuaternion(pose.orientation)
        const heading = Math.atan2(ahead.y, ahead.x) + angle
        hit.set(Math.cos(heading), Math.sin(heading), 0)
      }
      hit.multiplyScalar(range).add(center)
      if (isOpen) {
        fan.setXYZ(corners++, center.x, center.y, center.z)
        fan.setXYZ(corners++, points.getX(hits - 1), points.getY(hits - 1), points.getZ(hits - 1))
        fan.setXYZ(corners++, hit.x, hit.y, hit.z)
      }
      ranges.setX(hits, range)
      points.setXYZ(hits++, hit.x, hit.y, hit.z)
      isOpen = true
    }
    const isCircle = n * Math.abs(scan.angle_increment) > 2 * Math.PI - 0.5 * Math.abs(scan.angle_increment)
    if (isCircle && isOpen && hits > 1 && Number.isFinite(scan.ranges[0])) {
      fan.setXYZ(corners++, center.x, center.y, center.z)
      for (const i of [hits - 1, 0]) fan.setXYZ(corners++, points.getX(i), points.getY(i), points.getZ(i))
    }
    this.center.copy(center)
    this.points.setDrawRange(0, hits)
    this.fan.setDrawRange(0, corners)
    points.needsUpdate = ranges.needsUpdate = fan.needsUpdate = true
  }

  /** Lets the colours end at a round distance beyond all points, which does not change with each scan. */
  private fitColours(scan: LidarScan): void {
    let far = 0
    for (const range of scan.ranges) if (Number.isFinite(range) && range > far) far = range
    const { value: now } = this.farthest
    if (far > now || far < SHRINK * now) this.farthest.value = far > 0 ? niceStep(far) : now
    this.range.value = this.farthest.value || 1
  }

  dispose(): void {
    for (const part of [this.points, this.fan, this.pointMaterial, this.edgeMaterial, this.fanMaterial]) part.dispose()
  }
}

/** An attribute of a geometry with at least `count` points. */
function attribute(geometry: BufferGeometry, count: number, name = 'position', size = 3): BufferAttribute {
  const known = geometry.getAttribute(name) as BufferAttribute | undefined
  if (known && known.count >= count) return known
  geometry.dispose()
  const made = new BufferAttribute(new Float32Array(size * count), size)
  made.setUsage(DynamicDrawUsage)
  geometry.setAttribute(name, made)
  return made
}

const COLOURS = TURBO.map(([red, green, blue]) => new Vector3(red, green, blue))
const first: PlacedObject = { position: new Vector3(), orientation: new Quaternion() }
const last: PlacedObject = { position: new Vector3(), orientation: new Quaternion() }
const pose: PlacedObject = { position: new Vector3(), orientation: new Quaternion() }
const turn = new Quaternion()
const center = new Vector3()
const hit = new Vector3()
const ahead = new Vector3()
