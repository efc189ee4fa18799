// The three.js scene: the map, vehicles and objects of a Scene, with lights and shadows.

import type { Camera, IUniform, WebGLRenderer } from 'three'
import {
  type BufferGeometry,
  Color,
  GLSL3,
  InstancedMesh,
  LinearFilter,
  LinearMipmapLinearFilter,
  LinearMipmapNearestFilter,
  type Matrix3,
  Matrix4,
  Mesh,
  RepeatWrapping,
  ShaderMaterial,
  SRGBColorSpace,
  Texture,
  Scene as ThreeScene,
  Vector3,
  Vector4,
} from 'three'

import type { Scene } from '../messages'
import { hasSeveralVehicles, vehicleColour } from '../vehicle_colours'
import { daylight, effectsOf, extinction, inWeather, LAMPS_LIT } from './daylight'
import { type MeshPart, meshParts, shadowGeometry } from './geometry'
import type { Asset, Vector } from './glb'
import { GroundStrips } from './ground_strips'
import { LampGlare } from './lamp_glare'
import { ActiveLamps, BEAM_SLOTS, lampsOf } from './lamps'
import { type Lens, lensesOf } from './lenses'
import type { WorldState } from './motion'
import { Precipitation } from './precipitation'
import type { Profile } from './quality'
import { CASTER_SLOTS, SCENE_FRAGMENT, SCENE_VERTEX } from './shaders'
import { depthMaterial, Shadows, sunAxes } from './shadows'
import { Skeleton } from './skeleton'
import { Sky, setFlags } from './sky'
import { VehicleModel } from './vehicle'

/** Assets by their URL in the Scene. */
export type Assets = ReadonlyMap<string, Asset>

interface InstanceGroup {
  names: string[]
  meshes: InstancedMesh[]
}

export class World {
  readonly scene = new ThreeScene()
  private readonly light = {
    sun_direction: { value: new Vector3() },
    sun_color: { value: new Vector3() },
    zenith: { value: new Vector3() },
    horizon: { value: new Vector3() },
    floor_glow: { value: new Vector4() },
    exposure: { value: new Vector4() },
    sun_place: { value: new Vector4() },
    dawn: { value: new Vector4() },
    dusk: { value: 0 },
    extent: { value: new Vector4(-1e9, -1e9, 1e9, 1e9) },
    is_day: { value: 1 },
    caster_count: { value: 0 },
    beam_count: { value: 0 },
    head_count: { value: 0 },
    lamp_count: { value: 0 },
  }
  private readonly activeLamps = new ActiveLamps()
  private readonly places = { caster_place: { value: new Float32Array(4 * CASTER_SLOTS) } }
  private readonly shadows: Shadows
  private readonly sunFromMap: { value: Matrix3 }
  private sun = ''
  private readonly shared: Record<string, IUniform>
  private readonly vehicles = new Map<string, VehicleModel>()
  private readonly groups: InstanceGroup[] = []
  private readonly sky: Sky
  private readonly precipitation: Precipitation
  private readonly strips: GroundStrips | null
  private readonly surfaces: ShaderMaterial[] = []
  private effects = ''
  private readonly glare: LampGlare
  private readonly lenses: Lens[]
  private readonly disposables: { dispose(): void }[] = []

  constructor(
    private readonly description: Scene,
    assets: Assets,
    private readonly profile: Profile,
  ) {
    for (const [name, { model }] of Object.entries(description.vehicles)) {
      const lamps = lampsOf(description.vehicles[name], description.light_table.beams)
      const paint = hasSeveralVehicles(description) ? new Color(vehicleColour(description, name)).toArray() : null
      this.vehicles.set(name, new VehicleModel(asset(assets, model), lamps, paint as Vector | null))
    }
    const models = [...this.vehicles.values()]
    const extent = Math.max(0.05, ...models.map((model) => model.reach))
    const sun: number[] = description.light_table.day.sun_direction
    this.shadows = new Shadows(profile, sunAxes(sun), sun[2], 1.05 * extent)
    const lamps = {
      lamp_place: { value: this.activeLamps.position },
      lamp_aim: { value: this.activeLamps.aim },
      lamp_color: { value: this.activeLamps.color },
      lamp_up: { value: this.activeLamps.up },
    }
    this.sunFromMap = { value: sunAxes(sun) }
    const axes = { sun_from_map: this.sunFromMap }
    this.shared = { ...this.light, ...this.shadows.uniforms, ...this.places, ...lamps, ...axes }
    const map = asset(assets, description.model)
    if (map.extent) this.light.extent.value.fromArray(map.extent)
    const textures = this.textures(map)
    this.sky = new Sky(this.shared, textures[map.clouds] ?? null)
    const ground = description.ground.map((address) => asset(assets, address))
    const strips = [map, ...ground].flatMap((part) => part.strips ?? [])
    this.strips = strips.length > 0 ? new GroundStrips(strips) : null
    Object.assign(this.shared, this.strips?.uniform)
    this.lenses = lensesOf(map, () => this.material(null, null))
    for (const { mesh } of this.lenses) this.scene.add(mesh)
    this.glare = new LampGlare(models.length, this.lenses.length)
    this.precipitation = new Precipitation(this.shared)
    this.scene.add(this.sky.mesh, this.glare.points, ...this.precipitation.meshes)
    this.addMap(map, ground, textures)
    for (const model of models) this.scene.add(model.build(profile, (bones) => this.material(null, bones)))
    this.addObjects(assets)
  }

  /** Height of the image [pixels]. */
  set height(pixels: number) {
    this.glare.height = pixels
  }

  /** Updates all poses and lamps, `dt` [s] after the last update. The headlights of `followed` cast shadows. */
  update(state: WorldState, followed: string, cameraPosition: Vector3, dt: number): void {
    this.setLight(state)
    for (const [name, motion] of state.vehicles) {
      this.vehicles.get(name)?.update(motion, dt, cameraPosition.distanceTo(motion.position) < this.profile.fullDetail)
    }
    for (const group of this.groups) this.place(group, state)
    this.setLamps(followed)
    this.precipitation.update(state, this.effects.includes('AIR'))
    for (const lens of this.lenses) lens.show(state.trafficLights)
    this.glare.update([...this.vehicles.values()], this.lenses, this.light.dusk.value)
  }

  /** Share of the way from a point to another that is free of walls and buildings. */
  freeShare(from: Vector3, to: Vector3): number {
    return this.shadows.freeShare(from, to)
  }

  /** Draws the shadow maps for the current state. */
  drawShadows(renderer: WebGLRenderer, camera: Camera, followed: string): void {
    const cameraPosition = camera.position
    this.shadows.prepare(renderer)
    const models = [...this.vehicles.values()]
    const casters = models
      .sort((a, b) => a.distanceTo(cameraPosition) - b.distanceTo(cameraPosition))
      .slice(0, CASTER_SLOTS)
    for (const [slot, model] of casters.entries()) {
      model.footprint(this.places.caster_place.value, this.shadows.uniforms.caster_tile.value, 4 * slot)
    }
    this.light.caster_count.value = casters.length
    if (this.light.is_day.value === 1) {
      this.shadows.drawStatic(renderer, camera)
      this.shadows.drawCasters(renderer, casters)
    }
    if (this.activeLamps.beams > 0) {
      const own = this.vehicles.get(followed)
      const others = casters.filter((model) => model !== own).map((model) => model.caster)
      this.shadows.drawBeams(renderer, this.activeLamps, others)
    }
  }

  /** Prepares the sky, the air and the strips on the ground for a camera and an image of that size [pixels]. */
  prepare(renderer: WebGLRenderer, camera: Camera, width: number, height: number): void {
    camera.updateMatrixWorld()
    this.sky.prepare(camera)
    this.precipitation.prepare(camera)
    this.strips?.draw(renderer, camera, width, height)
  }

  /** Redraws the shadow maps, after the WebGL context was lost. */
  invalidateShadows(): void {
    this.shadows.invalidate()
  }

  dispose(): void {
    this.shadows.dispose()
    this.sky.dispose()
    this.precipitation.dispose()
    this.strips?.dispose()
    this.glare.dispose()
    for (const model of this.vehicles.values()) model.dispose()
    for (const { mesh } of this.lenses) mesh.geometry.dispose()
    for (const thing of this.disposables) thing.dispose()
  }

  // -- materials and objects ---------------------------------------------------------------------------------------

  private material(texture: Texture | null, bones: Record<string, IUniform> | null): ShaderMaterial {
    const { softness, isLightweight, beamMap } = this.profile
    const defines: Record<string, number> = { SHADOWS: softness }
    if (bones) defines.SKINNED = 1
    if (texture) defines.TEXTURED = 1
    if (isLightweight) defines.LIGHTWEIGHT = 1
    else if (texture) defines.FINE = 1
    if (beamMap > 0) defines.BEAM_SHADOWS = 1
    const uniforms = { ...this.shared, ...bones, surface_image: { value: texture } }
    const material = new ShaderMaterial({
      ...{ vertexShader: SCENE_VERTEX, fragmentShader: SCENE_FRAGMENT, glslVersion: GLSL3, defines, uniforms },
    })
    this.disposables.push(material)
    this.surfaces.push(material)
    return material
  }

  private textures(model: Asset): Texture[] {
    const before = textured.get(model)
    if (before?.profile === this.profile) return before.textures
    for (const texture of before?.textures ?? []) texture.dispose()
    const textures = model.images.map((image) => {
      const texture = new Texture(image)
      texture.flipY = false
      texture.colorSpace = SRGBColorSpace
      texture.wrapS = texture.wrapT = RepeatWrapping
      texture.minFilter = this.profile.isLightweight ? LinearMipmapNearestFilter : LinearMipmapLinearFilter
      texture.magFilter = LinearFilter
      texture.anisotropy = this.profile.anisotropy
      texture.needsUpdate = true
      return texture
    })
    textured.set(model, { profile: this.profile, textures })
    return textures
  }

  private keep(geometry: BufferGeometry): BufferGeometry {
    this.disposables.push(geometry)
    return geometry
  }

  /** The map; `ground`: the parts of its ground while it is built. */
  private addMap(model: Asset, ground: Asset[], textures: Texture[]): void {
    const materials = new Map<string, ShaderMaterial>()
    const add = (part: Asset, { geometry, image }: MeshPart) => {
      const name = part.imageNames[image] ?? ''
      const material = materials.get(name) ?? this.material(textures[model.imageNames.indexOf(name)] ?? null, null)
      if (this.strips) material.defines.STRIPS = 1
      materials.set(name, material)
      this.scene.add(new Mesh(geometry, material))
    }
    const skeleton = new Skeleton(model.nodes)
    for (const part of meshParts(model, skeleton, 'full', false)) {
      this.keep(part.geometry)
      add(model, part)
    }
    for (const part of ground) for (const one of groundParts(part)) add(part, one)
    const shadow = shadowGeometry(model, skeleton, 'shadow')
    if (shadow) this.shadows.staticScene.add(new Mesh(this.keep(shadow), this.keepDepth()))
  }

  private keepDepth(): ShaderMaterial {
    const material = depthMaterial(null)
    this.disposables.push(material)
    return material
  }

  private addObjects(assets: Assets): void {
    const objects = Object.entries(this.description.objects)
    for (const address of new Set(Object.values(this.description.objects))) {
      const names = objects.filter(([, model]) => model === address).map(([name]) => name)
      const model = asset(assets, address)
      const skeleton = new Skeleton(model.nodes)
      const textures = this.textures(model)
      const group: InstanceGroup = { names, meshes: [] }
      for (const { geometry, image } of meshParts(model, skeleton, 'full', true)) {
        const material = this.material(textures[image] ?? null, null)
        const mesh = new InstancedMesh(this.keep(geometry), material, names.length)
        group.meshes.push(mesh)
        this.scene.add(mesh)
      }
      const shadow = shadowGeometry(model, skeleton, 'shadow')
      if (shadow) {
        const mesh = new InstancedMesh(this.keep(shadow), this.keepDepth(), names.length)
        group.meshes.push(mesh)
        this.shadows.staticScene.add(mesh)
      }
      for (const mesh of group.meshes) {
        mesh.frustumCulled = false
        this.disposables.push(mesh)
      }
      this.groups.push(group)
    }
  }

  private place({ names, meshes }: InstanceGroup, state: WorldState): void {
    let isMoved = false
    names.forEach((name, i) => {
      const placed = state.objects.get(name)
      if (!placed) return
      pose.compose(placed.position, placed.orientation, ONE)
      meshes[0].getMatrixAt(i, before)
      for (const [k, value] of pose.elements.entries()) pose.elements[k] = Math.fround(value)
      if (pose.equals(before)) return
      isMoved = true
      for (const mesh of meshes) mesh.setMatrixAt(i, pose)
    })
    if (!isMoved) return
    this.shadows.isStaticMapOutdated = true
    for (const mesh of meshes) mesh.instanceMatrix.needsUpdate = true
  }

  private setLight({ isDay, timeOfDay, weather, sight }: WorldState): void {
    const look = inWeather(daylight(this.description.light_table, isDay, timeOfDay), weather)
    const effects = effectsOf(weather, sight, look.dusk)
    if (String(effects) !== this.effects) {
      this.effects = String(effects)
      for (const material of this.surfaces) setFlags(material, effects)
      this.sky.setHazy(effects.includes('AIR'))
    }
    const sun = String(look.sun_direction)
    if (isDay && sun !== this.sun) {
      this.sun = sun
      this.shadows.setSun(look.sun_direction)
      this.sunFromMap.value.copy(sunAxes(look.sun_direction))
    }
    for (const name of ['sun_direction', 'sun_color', 'zenith', 'horizon'] as const) {
      this.light[name].value.fromArray(look[name])
    }
    this.light.floor_glow.value.fromArray([...look.floor_glow, weather?.snow_cover ?? 0])
    for (const name of ['sun_place', 'dawn'] as const) this.light[name].value.set(...(look[name] as Vector), 0)
    this.light.exposure.value.set(look.exposure, look.glow, extinction(sight), weather?.wetness ?? 0)
    this.light.is_day.value = isDay ? 1 : 0
    this.light.dusk.value = look.dusk
  }

  /** Collects the lamps that are on; by day their light is not visible. */
  private setLamps(followed: string): void {
    const { activeLamps } = this
    activeLamps.clear()
    if (this.light.dusk.value >= LAMPS_LIT) {
      const own = this.vehicles.get(followed)
      const others = [...this.vehicles.values()].filter((model) => model !== own)
      own?.light(activeLamps, true)
      if (this.profile.beamMap > 0) activeLamps.beams = Math.min(activeLamps.lamps, BEAM_SLOTS)
      for (const model of others) model.light(activeLamps, true)
      for (const model of own ? [own, ...others] : others) model.light(activeLamps, false)
    }
    this.light.beam_count.value = activeLamps.beams
    this.light.head_count.value = activeLamps.heads
    this.light.lamp_count.value = activeLamps.lamps
  }
}

/** The geometry of parts of the ground, which the next World has again if an edit did not change them. */
const made = new WeakMap<Asset, MeshPart[]>()
/** The textures of assets, for a profile, also for the next World. */
const textured = new WeakMap<Asset, { profile: Profile; textures: Texture[] }>()

function groundParts(part: Asset): MeshPart[] {
  const parts = made.get(part) ?? meshParts(part, new Skeleton(part.nodes), 'full', false)
  made.set(part, parts)
  return parts
}

/** Frees what the Worlds share of an asset that no World has any more. */
export function release(part: Asset): void {
  for (const { geometry } of made.get(part) ?? []) geometry.dispose()
  made.delete(part)
  for (const texture of textured.get(part)?.textures ?? []) texture.dispose()
  textured.delete(part)
}

function asset(assets: Assets, address: string): Asset {
  const found = assets.get(address)
  if (!found) throw new Error(`${address} was not loaded`)
  return found
}

const ONE = new Vector3(1, 1, 1)
const pose = new Matrix4()
const before = new Matrix4()
