// The 3D view of the page: what the store holds, drawn at the rate of the screen.
import type { Quality, Store } from '../store'
import type { Frame, Scene } from '../messages'
import { type Asset, loadAsset } from './glb'
import { Motion } from './motion'
import { Painter } from './painter'
import { type Profile, QualityChoice } from './quality'
import { ScanView } from './scan'
import { StreamView } from './stream'
import { birdHeight, Viewpoints } from './viewpoints'
import { World } from './world'

export interface SceneStats {
  /** Draw calls and triangles of the latest picture, shadow maps and all. */
  calls: number
  triangles: number
  /** What draws, in the words of its driver. */
  renderer: string
  profile: string
}

export interface SceneView {
  stats(): SceneStats
  resize(): void
  dispose(): void
}

/** Draws the store's scene on that canvas until disposed of. */
export function showScene(canvas: HTMLCanvasElement, store: Store): SceneView {
  return new View(canvas, store)
}

const QUALITIES: readonly Quality[] = ['auto', 'low', 'high', 'ultra', 'stream']
/** A click of the mouse wheel, in the units of its event [pixels]. */
const CLICK = 100
const NO_WEBGL = 'This browser offers no WebGL: only the simulator can draw the scene.'
const TOO_SLOW = 'This computer draws slowly: the simulator draws the scene.'

class View implements SceneView {
  private readonly painter: Painter | null
  private readonly motion = new Motion()
  private readonly viewpoints: Viewpoints
  private readonly scan = new ScanView()
  private readonly stream: StreamView
  private readonly choice: QualityChoice
  private readonly assets = new Map<string, Asset>()
  private readonly ends: (() => void)[] = []
  private scene: Scene | null = null
  private world: World | null = null
  private profile: Profile
  private before = 0
  private pictures = 0
  private counted = 0
  private turned = 0
  private animation = 0

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly store: Store,
  ) {
    this.painter = Painter.on(canvas)
    this.choice = new QualityChoice(this.painter?.isSoftware ?? true)
    const wanted = QUALITIES.find((quality) => quality === new URLSearchParams(location.search).get('quality'))
    if (wanted) store.quality.value = wanted
    this.profile = this.choice.profile(store.quality.value)
    this.viewpoints = new Viewpoints(canvas)
    this.stream = new StreamView(canvas)
    this.stream.onPicture = () => this.pictures++
    if (!this.painter) this.giveUp(NO_WEBGL)
    this.listen()
    this.resize()
    this.animation = requestAnimationFrame(this.draw)
  }

  stats(): SceneStats {
    const isStream = this.store.quality.value === 'stream'
    const { calls, triangles, renderer } = this.painter ?? { calls: 0, triangles: 0, renderer: 'none' }
    return { calls, triangles, renderer, profile: isStream ? 'stream' : this.profile.name }
  }

  resize(): void {
    this.stream.resize()
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight]
    if (!this.painter || width === 0 || height === 0) return
    this.painter.resize(width, height, this.profile)
    this.viewpoints.camera.aspect = width / height
    this.scan.pixelRatio = this.painter.ratio
    if (this.world) this.world.height = height * this.painter.ratio
  }

  dispose(): void {
    cancelAnimationFrame(this.animation)
    for (const end of this.ends) end()
    this.world?.dispose()
    this.scan.dispose()
    this.viewpoints.dispose()
    this.stream.dispose()
    this.painter?.dispose()
  }

  // -- what is watched -------------------------------------------------------------------------------------------

  private listen(): void {
    const { store, canvas } = this
    this.ends.push(
      store.scene.watch((scene) => void this.enter(scene)),
      store.frame.watch((frame) => frame && this.take(frame)),
      store.quality.watch(() => this.setQuality()),
      store.rendered.watch((picture) => picture && store.quality.value === 'stream' && this.stream.show(picture)),
    )
    const wheel = (event: WheelEvent) => this.zoom(event)
    canvas.addEventListener('wheel', wheel, { passive: false })
    const size = new ResizeObserver(() => this.resize())
    size.observe(canvas)
    this.ends.push(
      () => canvas.removeEventListener('wheel', wheel),
      () => size.disconnect(),
    )
    // a hidden tab is not a slow one
    const shown = () => this.choice.restart(performance.now() / 1000)
    document.addEventListener('visibilitychange', shown)
    this.ends.push(() => document.removeEventListener('visibilitychange', shown))
    const restored = () => this.world?.redraw()
    canvas.addEventListener('webglcontextrestored', restored)
    this.ends.push(() => canvas.removeEventListener('webglcontextrestored', restored))
  }

  private take(frame: Frame): void {
    // the first Frame of a scenario follows its Scene
    if (this.store.scene.value) this.motion.take(frame, performance.now() / 1000)
  }

  /** Loads what the Scene names and shows it. */
  private async enter(scene: Scene | null): Promise<void> {
    this.scene = scene
    this.motion.clear()
    this.scan.clear()
    this.viewpoints.restart()
    if (!scene || !this.painter) return
    try {
      await this.load(scene)
    } catch (fault) {
      this.store.notice.value = `The scene cannot be drawn: ${(fault as Error).message}`
    }
    // another may have come while this one was loaded
    if (this.scene === scene) this.build()
  }

  private async load(scene: Scene): Promise<void> {
    const vehicles = Object.values(scene.vehicles).map((vehicle) => vehicle.model)
    const wanted = new Set([scene.model, ...vehicles, ...Object.values(scene.objects)])
    for (const address of this.assets.keys()) if (!wanted.has(address)) this.assets.delete(address)
    const missing = [...wanted].filter((address) => !this.assets.has(address))
    const loaded = await Promise.all(missing.map((address) => loadAsset(this.address(address))))
    missing.forEach((address, i) => this.assets.set(address, loaded[i]))
  }

  private address(relative: string): URL {
    const url = new URL(relative, document.baseURI)
    const token = new URLSearchParams(location.search).get('token')
    if (token) url.searchParams.set('token', token)
    return url
  }

  /** Makes the world anew, for this scene and profile. */
  private build(): void {
    this.world?.dispose()
    this.world = null
    const { scene } = this
    if (!scene || !this.assets.has(scene.model)) return
    this.world = new World(scene, this.assets, this.profile)
    this.world.stage.add(this.scan.group)
    this.resize()
    this.choice.restart(performance.now() / 1000)
  }

  private setQuality(): void {
    const quality = this.store.quality.value
    if (quality !== 'stream' && !this.painter) this.store.notice.value = NO_WEBGL
    this.stream.isShown = quality === 'stream'
    if (quality === 'stream') this.viewpoints.controls.enabled = false
    const profile = this.choice.profile(quality)
    this.choice.restart(performance.now() / 1000)
    if (quality === 'stream' || profile === this.profile) return
    this.profile = profile
    this.build()
    this.resize()
  }

  private giveUp(notice: string): void {
    this.store.notice.value = notice
    this.store.quality.value = 'stream'
  }

  private zoom(event: WheelEvent): void {
    const { store } = this
    if (store.camera.value !== "Bird's Eye" || !store.scene.value) return
    event.preventDefault()
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : CLICK / 3
    this.turned -= (event.deltaY * lines) / CLICK
    const clicks = Math.trunc(this.turned)
    if (clicks === 0) return
    this.turned -= clicks
    store.birdHeight.value = birdHeight(store.scene.value, store.birdHeight.value, clicks)
  }

  // -- drawing ---------------------------------------------------------------------------------------------------

  private readonly draw = (milliseconds: number): void => {
    this.animation = requestAnimationFrame(this.draw)
    const now = milliseconds / 1000
    const dt = Math.max(0, now - this.before)
    this.before = now
    if (document.hidden) return
    this.count(now)
    if (this.store.quality.value === 'stream' || !this.painter) return
    if (this.paint(now, Math.min(dt, 0.25)) && this.store.quality.value === 'auto') this.judge(dt, now)
  }

  private paint(now: number, dt: number): boolean {
    const { painter, world, scene, store, motion, viewpoints } = this
    if (!painter || !world || !scene || motion.isEmpty) return false
    const moment = motion.advance(performance.now() / 1000)
    const watched = moment.vehicles.has(store.vehicle.value) ? store.vehicle.value : [...moment.vehicles.keys()][0]
    const car = moment.vehicles.get(watched)
    if (!car) return false
    const vehicle = scene.vehicles[watched]
    viewpoints.update(store.camera.value, scene, car, dt, store.birdHeight.value, vehicle.half_length)
    const scan = store.isScanShown.value ? (store.scans.get(watched) ?? null) : null
    this.scan.show(scan, watched, vehicle.lidar, motion)
    painter.paint(world, viewpoints.camera, moment, watched, dt)
    this.pictures++
    return now > 0
  }

  private count(now: number): void {
    if (now - this.counted < 0.5) return
    this.store.frameRate.value = this.pictures / (now - this.counted)
    this.counted = now
    this.pictures = 0
  }

  private judge(duration: number, now: number): void {
    const verdict = this.choice.measure(duration, now)
    if (verdict === 'hopeless') this.giveUp(TOO_SLOW)
    else if (verdict === 'change') this.setQuality()
  }
}
