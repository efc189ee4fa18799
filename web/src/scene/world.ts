// The world as three.js draws it: map, vehicles and boxes of a Scene, their light and their shadows.
import {
  BufferGeometry,
  GLSL3,
  InstancedMesh,
  LinearFilter,
  LinearMipmapLinearFilter,
  LinearMipmapNearestFilter,
  Matrix4,
  Mesh,
  RepeatWrapping,
  Scene as Stage,
  ShaderMaterial,
  SRGBColorSpace,
  Texture,
  Vector2,
  Vector3,
} from 'three'
import type { Camera, IUniform, WebGLRenderer } from 'three'

import type { Scene } from '../messages'
import type { Asset } from './glb'
import { pieces, outline } from './geometry'
import { Halos } from './halos'
import { BEAM_SLOTS, Burning, lampsOf } from './lamps'
import type { Moment } from './motion'
import type { Profile } from './quality'
import { Rig } from './rig'
import { CASTER_SLOTS, SCENE_FRAGMENT, SCENE_VERTEX } from './shaders'
import { depthMaterial, Shadows, sunAxes } from './shadows'
import { Sky } from './sky'
import { VehicleModel } from './vehicle'

/** Assets by the address that the Scene names. */
export type Assets = ReadonlyMap<string, Asset>

interface Crowd {
  names: string[]
  meshes: InstancedMesh[]
}

export class World {
  readonly stage = new Stage()
  private readonly light = {
    sun_direction: { value: new Vector3() },
    sun_color: { value: new Vector3() },
    zenith: { value: new Vector3() },
    horizon: { value: new Vector3() },
    floor_glow: { value: new Vector3() },
    exposure: { value: new Vector2() },
    is_day: { value: 1 },
    caster_count: { value: 0 },
    beam_count: { value: 0 },
    head_count: { value: 0 },
    lamp_count: { value: 0 },
  }
  private readonly burning = new Burning()
  private readonly places = { caster_place: { value: new Float32Array(4 * CASTER_SLOTS) } }
  private readonly shadows: Shadows
  private readonly shared: Record<string, IUniform>
  private readonly vehicles = new Map<string, VehicleModel>()
  private readonly crowds: Crowd[] = []
  private readonly sky: Sky
  private readonly halos: Halos
  private readonly rubbish: { dispose(): void }[] = []

  constructor(
    private readonly scene: Scene,
    assets: Assets,
    private readonly profile: Profile,
  ) {
    for (const [name, { model }] of Object.entries(scene.vehicles)) {
      const lamps = lampsOf(scene.vehicles[name], scene.light_table.beams)
      this.vehicles.set(name, new VehicleModel(asset(assets, model), lamps))
    }
    const models = [...this.vehicles.values()]
    const extent = Math.max(0.05, ...models.map((model) => model.reach))
    const sun: number[] = scene.light_table.day.sun_direction
    this.shadows = new Shadows(profile, sunAxes(sun), sun[2], 1.05 * extent)
    this.shadows.uniforms.caster_half.value.setX(Math.max(0, ...models.map((model) => model.half.x)))
    this.shadows.uniforms.caster_half.value.setY(Math.max(0, ...models.map((model) => model.half.y)))
    const lamps = {
      lamp_place: { value: this.burning.place },
      lamp_aim: { value: this.burning.aim },
      lamp_color: { value: this.burning.color },
      lamp_up: { value: this.burning.up },
    }
    const axes = { sun_from_map: { value: sunAxes(sun) } }
    this.shared = { ...this.light, ...this.shadows.uniforms, ...this.places, ...lamps, ...axes }
    this.sky = new Sky(this.shared)
    this.halos = new Halos(models.length)
    this.stage.add(this.sky.mesh, this.halos.points)
    this.addMap(asset(assets, scene.model))
    for (const model of models) this.stage.add(model.build(profile, (bones) => this.material(null, bones)))
    this.addObjects(assets)
  }

  /** Of the picture [pixels]. */
  set height(pixels: number) {
    this.halos.height = pixels
  }

  /** Puts everything where it is; `watched` is the vehicle whose headlights cast shadows, `dt` [s] since the last. */
  update(moment: Moment, watched: string, eye: Vector3, dt: number): void {
    this.setLight(moment.isDay)
    for (const [name, motion] of moment.vehicles) {
      this.vehicles.get(name)?.update(motion, dt, eye.distanceTo(motion.position) < this.profile.fullDetail)
    }
    for (const crowd of this.crowds) this.place(crowd, moment)
    this.setLamps(moment.isDay, watched)
    this.halos.update([...this.vehicles.values()], moment.isDay)
  }

  /** Draws the shadow maps of this moment. */
  drawShadows(renderer: WebGLRenderer, eye: Vector3, watched: string): void {
    this.shadows.prepare(renderer)
    const models = [...this.vehicles.values()]
    const casters = models.sort((a, b) => a.distanceTo(eye) - b.distanceTo(eye)).slice(0, CASTER_SLOTS)
    casters.forEach((model, slot) => model.footprint(this.places.caster_place.value, 4 * slot))
    this.light.caster_count.value = casters.length
    if (this.light.is_day.value === 1) {
      this.shadows.drawStill(renderer)
      this.shadows.drawCasters(renderer, casters)
    } else {
      const own = this.vehicles.get(watched)
      const others = casters.filter((model) => model !== own).map((model) => model.caster)
      this.shadows.drawBeams(renderer, this.burning, others)
    }
  }

  /** What a camera needs before it looks. */
  prepare(camera: Camera): void {
    this.sky.prepare(camera)
  }

  /** The maps are lost, for example with the context. */
  redraw(): void {
    this.shadows.forget()
  }

  dispose(): void {
    this.shadows.dispose()
    this.sky.dispose()
    this.halos.dispose()
    for (const model of this.vehicles.values()) model.dispose()
    for (const thing of this.rubbish) thing.dispose()
  }

  // -- parts -----------------------------------------------------------------------------------------------------

  private material(picture: Texture | null, bones: Record<string, IUniform> | null): ShaderMaterial {
    const { softness, isLightweight, beamMap } = this.profile
    const defines: Record<string, number> = { SHADOWS: softness }
    if (bones) defines.RIGGED = 1
    if (picture) defines.TEXTURED = 1
    if (isLightweight) defines.LIGHTWEIGHT = 1
    if (beamMap > 0) defines.BEAM_SHADOWS = 1
    const uniforms = { ...this.shared, ...bones, picture: { value: picture } }
    const material = new ShaderMaterial({
      ...{ vertexShader: SCENE_VERTEX, fragmentShader: SCENE_FRAGMENT, glslVersion: GLSL3, defines, uniforms },
    })
    this.rubbish.push(material)
    return material
  }

  private textures(model: Asset): Texture[] {
    return model.pictures.map((picture) => {
      const texture = new Texture(picture)
      texture.flipY = false
      texture.colorSpace = SRGBColorSpace
      texture.wrapS = texture.wrapT = RepeatWrapping
      texture.minFilter = this.profile.isLightweight ? LinearMipmapNearestFilter : LinearMipmapLinearFilter
      texture.magFilter = LinearFilter
      texture.anisotropy = this.profile.anisotropy
      texture.needsUpdate = true
      this.rubbish.push(texture)
      return texture
    })
  }

  private keep(geometry: BufferGeometry): BufferGeometry {
    this.rubbish.push(geometry)
    return geometry
  }

  private addMap(model: Asset): void {
    const rig = new Rig(model.nodes)
    const textures = this.textures(model)
    for (const { geometry, picture } of pieces(model, rig, 'full', false)) {
      this.stage.add(new Mesh(this.keep(geometry), this.material(textures[picture] ?? null, null)))
    }
    const shade = outline(model, rig, 'shadow')
    if (shade) this.shadows.still.add(new Mesh(this.keep(shade), this.keepDepth()))
  }

  private keepDepth(): ShaderMaterial {
    const material = depthMaterial(null)
    this.rubbish.push(material)
    return material
  }

  private addObjects(assets: Assets): void {
    const objects = Object.entries(this.scene.objects)
    for (const address of new Set(Object.values(this.scene.objects))) {
      const names = objects.filter(([, model]) => model === address).map(([name]) => name)
      const model = asset(assets, address)
      const rig = new Rig(model.nodes)
      const textures = this.textures(model)
      const crowd: Crowd = { names, meshes: [] }
      for (const { geometry, picture } of pieces(model, rig, 'full', true)) {
        const material = this.material(textures[picture] ?? null, null)
        const mesh = new InstancedMesh(this.keep(geometry), material, names.length)
        crowd.meshes.push(mesh)
        this.stage.add(mesh)
      }
      const shade = outline(model, rig, 'shadow')
      if (shade) {
        const mesh = new InstancedMesh(this.keep(shade), this.keepDepth(), names.length)
        crowd.meshes.push(mesh)
        this.shadows.still.add(mesh)
      }
      for (const mesh of crowd.meshes) {
        mesh.frustumCulled = false
        this.rubbish.push(mesh)
      }
      this.crowds.push(crowd)
    }
  }

  private place({ names, meshes }: Crowd, moment: Moment): void {
    let isMoved = false
    names.forEach((name, i) => {
      const placed = moment.objects.get(name)
      if (!placed) return
      pose.compose(placed.position, placed.orientation, ONE)
      meshes[0].getMatrixAt(i, before)
      pose.elements.forEach((value, k) => (pose.elements[k] = Math.fround(value)))
      if (pose.equals(before)) return
      isMoved = true
      for (const mesh of meshes) mesh.setMatrixAt(i, pose)
    })
    if (!isMoved) return
    this.shadows.isStillOld = true
    for (const mesh of meshes) mesh.instanceMatrix.needsUpdate = true
  }

  private setLight(isDay: boolean): void {
    const look = this.scene.light_table[isDay ? 'day' : 'night']
    for (const name of ['sun_direction', 'sun_color', 'zenith', 'horizon', 'floor_glow'] as const) {
      this.light[name].value.fromArray(look[name])
    }
    this.light.exposure.value.set(look.exposure, look.glow)
    this.light.is_day.value = isDay ? 1 : 0
  }

  /** By day lamps light nothing that could be seen. */
  private setLamps(isDay: boolean, watched: string): void {
    const { burning } = this
    burning.clear()
    if (!isDay) {
      const own = this.vehicles.get(watched)
      const others = [...this.vehicles.values()].filter((model) => model !== own)
      own?.light(burning, true)
      if (this.profile.beamMap > 0) burning.beams = Math.min(burning.lamps, BEAM_SLOTS)
      for (const model of others) model.light(burning, true)
      for (const model of own ? [own, ...others] : others) model.light(burning, false)
    }
    this.light.beam_count.value = burning.beams
    this.light.head_count.value = burning.heads
    this.light.lamp_count.value = burning.lamps
  }
}

function asset(assets: Assets, address: string): Asset {
  const found = assets.get(address)
  if (!found) throw new Error(`${address} was not loaded`)
  return found
}

const ONE = new Vector3(1, 1, 1)
const pose = new Matrix4()
const before = new Matrix4()
