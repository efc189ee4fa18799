// The 3D view of the page: draws the contents of the store at the refresh rate of the screen.
import { Matrix4, Vector3 } from 'three'

import type { Frame, Scene } from '../messages'
import type { Store } from '../store'
import type { Trails } from '../trails'
import { sceneUrl } from './assets'
import { isBright } from './daylight'
import { DrawingView } from './drawing_view'
import { EditCamera } from './edit_camera'
import { type Asset, loadAsset } from './glb'
import { drawLabels, Labels } from './labels'
import { MotionInterpolator } from './motion'
import { OverlayView } from './overlay_view'
import { showPreview } from './preview'
import { type Profile, QualityChoice } from './quality'
import { RemoteImage } from './remote_image'
import { Renderer } from './renderer'
import { ScanView } from './scan'
import { TrailView } from './trail_view'
import { Viewpoints } from './viewpoints'
import { release, World } from './world'
import { lensZoomOf, wheelClicks, zoomCamera } from './zoom'

export interface SceneStats {
  /** Draw calls and triangles of the latest image, including shadow maps. */
  calls: number
  triangles: number
  /** Name of the WebGL renderer, as reported by its driver. */
  driver: string
  profile: string
}

export interface SceneView {
  stats(): SceneStats
  /** Where a point of the map [m] is on the screen [CSS pixels]; null if it is behind the camera. */
  screenPoint(x: number, y: number, z: number): [x: number, y: number] | null
  /** The point of the ground (z = 0) at a place of the screen [CSS pixels]; null above the horizon. */
  groundPoint(x: number, y: number): [x: number, y: number] | null
  /** In Edit mode: moves the camera above a point of the map [m] that is outside the image or covered by a panel. */
  showPlace(x: number, y: number): void
  /** In Edit mode: moves the camera above a point of the map [m]. */
  lookAt(x: number, y: number): void
  /** In Edit mode: shows an area around a point, with its width along x [m]. */
  showArea(x: number, y: number, width: number): void
  /** In Edit mode: moves the camera nearer by that number of clicks. */
  zoomEdit(clicks: number): void
  /** The present image with the labels of the vehicles, as a PNG file; null if there is none. */
  picture(): Promise<Blob | null>
  resize(): void
  dispose(): void
}

/** Draws the scene of the store on the canvas until `dispose` is called. */
export function showScene(canvas: HTMLCanvasElement, store: Store, trails: Trails): SceneView {
  return new View(canvas, store, trails)
}

/** The controls of the orbit listen to the same event, but zoom by another factor. */
const WHEEL = { passive: false, capture: true }
/** Aspect ratio of the images of the simulator; they fill the canvas and are cut at two edges. */
const STREAM_ASPECT = 16 / 9
/** Time between two images that the page draws while it waits for the first one of the simulator [s]. */
const WAITING_PERIOD = 0.5
/** Motion is drawn that long after the latest Frame, which is shown with a delay [s]. */
const SETTLING = 0.5
/** An image that takes longer leaves as much time to the rest of the page, before one that shows only motion [s]. */
const SLOW_IMAGE = 0.05
/** While the simulator starts, a slow image leaves so many times its time to the compiler, which needs all processors. */
const STARTING_REST = 8
/** First distance of the camera in Build mode; 1: that of Edit mode. */
const BUILD_DISTANCE = 1.8
/** Between a panel and the middle of the edge of an area beside it, whose near corner is nearer [CSS pixels]. */
const GAP = 50
const NO_WEBGL = 'WebGL is not available in this browser. The simulator renders the scene.'
const LOST = 'The graphics context of this page was lost, perhaps because the driver of the graphics card restarted.'
/** Time for the browser to restore it [ms]; then the simulator renders. */
const RESTORING = 3000
const TOO_SLOW = 'This computer renders slowly. The simulator renders the scene.'

class View implements SceneView {
  private readonly renderer: Renderer | null
  private readonly motion = new MotionInterpolator()
  private readonly viewpoints: Viewpoints
  private readonly editCamera: EditCamera
  private readonly scan: ScanView
  private readonly labels: Labels
  private readonly trailView = new TrailView()
  private readonly drawingView = new DrawingView()
  private readonly overlayView = new OverlayView()
  private readonly remote: RemoteImage
  private readonly choice: QualityChoice
  private readonly assets = new Map<string, Asset>()
  /** Assets that the next World does not have. */
  private readonly dropped: Asset[] = []
  private readonly cleanups: (() => void)[] = []
  private scene: Scene | null = null
  private world: World | null = null
  /** The World before, until the first image of the next one: it then has the same compiled shaders. */
  private replaced: World | null = null
  /** Whether the World of an edited scene is being made: no image shows the old one meanwhile. */
  private isReplaced = false
  private profile: Profile
  private isContextLost = false
  private before = 0
  /** Wall times of the latest image, and of the latest Frame and other change that it may not show yet [s]. */
  private drawnAt = 0
  private movedAt = 0
  private changedAt = 0
  /** Time that the latest image took, until the page could draw the next one [s]. */
  private took = 0
  /** The camera of the latest image. */
  private readonly drawnFrom = [new Matrix4(), new Matrix4()]
  private images = 0
  private counted = 0
  private turned = 0
  private animation = 0
  /** Draws the latest image once more. */
  private draw = (): void => {}
  private pointer: readonly [number, number] = [-1e6, -1e6]
  /** The canvas on the screen; asking the browser for each point would compute the layout of the page each time. */
  private place = new DOMRect()

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly store: Store,
    private readonly trails: Trails,
  ) {
    this.renderer = Renderer.create(canvas)
    this.choice = new QualityChoice(this.renderer?.isSoftware ?? true)
    this.profile = this.choice.profile(store.quality.value)
    this.viewpoints = new Viewpoints(canvas, store)
    this.labels = new Labels(canvas)
    this.scan = new ScanView(store.scanFarthest)
    this.editCamera = new EditCamera(canvas)
    this.remote = new RemoteImage(canvas)
    this.remote.onImage = () => this.countStreamed()
    if (!this.renderer) this.useRemoteView(NO_WEBGL)
    this.listen()
    this.resize()
    this.animation = requestAnimationFrame(this.drawFrame)
  }

  stats(): SceneStats {
    const isStream = this.store.quality.value === 'stream'
    const { calls, triangles, driver } = this.renderer ?? { calls: 0, triangles: 0, driver: 'none' }
    return { calls, triangles, driver, profile: isStream ? 'stream' : this.profile.name }
  }

  screenPoint(x: number, y: number, z: number): [x: number, y: number] | null {
    const { camera } = this.viewpoints
    const at = point.set(x, y, z).applyMatrix4(camera.matrixWorldInverse)
    if (at.z > -camera.near) return null
    at.applyMatrix4(camera.projectionMatrix)
    const { left, top, width, height } = this.place
    return [left + 0.5 * width * (1 + at.x), top + 0.5 * height * (1 - at.y)]
  }

  groundPoint(x: number, y: number): [x: number, y: number] | null {
    const { camera } = this.viewpoints
    const { left, top, width, height } = this.place
    const to = point.set((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height, 0.5).unproject(camera)
    const eye = camera.position
    const share = eye.z / (eye.z - to.z)
    return share > 0 && Number.isFinite(share) ? [eye.x + share * (to.x - eye.x), eye.y + share * (to.y - eye.y)] : null
  }

  showPlace(x: number, y: number): void {
    const at = this.screenPoint(x, y, 0)
    if (this.store.isMapViewed && (!at || document.elementFromPoint(...at) !== this.canvas))
      this.editCamera.moveTo(x, y)
  }

  lookAt(x: number, y: number): void {
    this.editCamera.moveTo(x, y)
  }

  showArea(x: number, y: number, width: number): void {
    const { width: all } = this.canvas.getBoundingClientRect()
    const panel = document.querySelector('.panel.edit:not([hidden])')?.getBoundingClientRect()
    const isBeside = panel && panel.right < all / 2
    this.editCamera.showArea(x, y, width, isBeside ? (panel.right + GAP) / all : 0)
  }

  zoomEdit(clicks: number): void {
    this.editCamera.zoom(clicks)
  }

  async picture(): Promise<Blob | null> {
    const { canvas, renderer, remote, profile } = this
    const isStream = this.isStreamed
    const [width, height] = [canvas.clientWidth, canvas.clientHeight]
    const picture = document.createElement('canvas')
    const context = picture.getContext('2d')
    const image = isStream ? remote.image : canvas
    if (!context || (!isStream && (!renderer || !this.world))) return null
    if (!isStream) {
      // at the resolution of the screen, even if the view has a lower one; the browser clears the canvas later
      if (profile.pixelRatio < 1) renderer?.resize(width, height, { ...profile, pixelRatio: 1 })
      this.draw()
    }
    ;[picture.width, picture.height] = [image.width, image.height]
    if (picture.width === 0 || picture.height === 0) return null
    context.drawImage(image, 0, 0)
    if (!isStream) drawLabels(context, this.labels.all, image.width / width)
    if (profile.pixelRatio < 1) this.resize()
    return new Promise((done) => picture.toBlob(done, 'image/png'))
  }

  resize(): void {
    this.remote.resize()
    this.place = this.canvas.getBoundingClientRect()
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight]
    if (width === 0 || height === 0) return
    this.viewpoints.camera.aspect = width / height
    if (!this.renderer) return
    this.renderer.resize(width, height, this.profile)
    this.scan.pixelRatio = this.renderer.ratio
    if (this.world) this.world.height = height * this.renderer.ratio
    this.changedAt = performance.now() / 1000
  }

  dispose(): void {
    cancelAnimationFrame(this.animation)
    for (const cleanup of this.cleanups) cleanup()
    this.forget()
    this.world?.dispose()
    this.scan.dispose()
    this.labels.dispose()
    this.trailView.dispose()
    this.drawingView.dispose()
    this.overlayView.dispose()
    this.viewpoints.dispose()
    this.editCamera.dispose()
    this.remote.dispose()
    this.renderer?.dispose()
  }

  // -- scene and assets --------------------------------------------------------------------------------------------

  private listen(): void {
    const { store, canvas } = this
    this.cleanups.push(
      store.scene.watch((scene) => void this.showScene(scene)),
      store.ways.watch((ways) => ways && this.trails.addWays(ways, this.wheelRadius)),
      store.frame.watch((frame) => frame && this.addFrame(frame)),
      store.quality.watch(() => this.setQuality()),
      store.rendered.watch((image) => image && this.isStreamWanted && this.remote.show(image)),
      ...[store.isEditing, store.isBuilding, store.isTurning].map((one) => one.watch(() => this.pauseStream())),
    )
    const change = () => {
      this.changedAt = performance.now() / 1000
    }
    this.cleanups.push(...store.watchImage(change))
    const wheel = (event: WheelEvent) => this.zoom(event)
    canvas.addEventListener('wheel', wheel, WHEEL)
    const point = ({ clientX, clientY }: PointerEvent) => {
      this.pointer = [clientX, clientY]
    }
    window.addEventListener('pointermove', point)
    this.cleanups.push(() => window.removeEventListener('pointermove', point))
    const size = new ResizeObserver(() => this.resize())
    size.observe(canvas)
    this.cleanups.push(
      () => canvas.removeEventListener('wheel', wheel, WHEEL),
      () => size.disconnect(),
    )
    // hidden pages draw no frames, so their times must not count
    const shown = () => this.choice.restart(performance.now() / 1000)
    document.addEventListener('visibilitychange', shown)
    this.cleanups.push(() => document.removeEventListener('visibilitychange', shown))
    let timer = 0
    const lost = () => {
      this.isContextLost = true
      this.store.warning.value = LOST
      timer = window.setTimeout(() => this.useRemoteView(NO_WEBGL), RESTORING)
    }
    const restored = () => {
      window.clearTimeout(timer)
      this.isContextLost = false
      this.world?.invalidateShadows()
      change()
    }
    canvas.addEventListener('webglcontextlost', lost)
    canvas.addEventListener('webglcontextrestored', restored)
    this.cleanups.push(() => {
      window.clearTimeout(timer)
      canvas.removeEventListener('webglcontextlost', lost)
      canvas.removeEventListener('webglcontextrestored', restored)
    })
  }

  private readonly wheelRadius = (vehicle: string): number =>
    this.store.scene.value?.vehicles[vehicle]?.wheel_radius ?? 0

  private addFrame(frame: Frame): void {
    // a Frame before the first Scene cannot be drawn
    const scene = this.store.scene.value
    if (!scene) return
    this.movedAt = performance.now() / 1000
    this.motion.add(frame, this.movedAt)
    this.trails.add(frame, this.wheelRadius)
  }

  /** Loads the assets of the Scene, then shows it. */
  private async showScene(scene: Scene | null): Promise<void> {
    const isEdited = scene !== null && this.scene?.scenario === scene.scenario
    if (!isEdited) this.trails.reset()
    this.scene = scene
    this.isReplaced = isEdited
    if (this.store.quality.value === 'stream') this.startStream()
    this.motion.clear()
    this.scan.clear()
    this.labels.show(scene)
    if (!isEdited) this.viewpoints.restart()
    if (!scene || !this.renderer) return
    try {
      await this.load(scene)
    } catch (error) {
      this.store.warning.value = `The scene could not be loaded: ${(error as Error).message}`
    }
    // another Scene may have arrived in the meantime
    if (this.scene === scene) this.build()
  }

  private async load(scene: Scene): Promise<void> {
    const vehicles = Object.values(scene.vehicles).map((vehicle) => vehicle.model)
    const wanted = new Set([scene.model, ...scene.ground, ...vehicles, ...Object.values(scene.objects)])
    for (const [address, asset] of this.assets) {
      if (wanted.has(address)) continue
      this.assets.delete(address)
      this.dropped.push(asset)
    }
    const missing = [...wanted].filter((address) => !this.assets.has(address))
    const { sceneBytes } = this.store
    sceneBytes.value = 0
    const received = (bytes: number): void => {
      if (this.scene === scene) sceneBytes.value += bytes
    }
    const loaded = await Promise.all(missing.map((address) => loadAsset(sceneUrl(address), received)))
    for (const [i, address] of missing.entries()) this.assets.set(address, loaded[i])
  }

  /** Builds the world for the current scene and profile. */
  private build(): void {
    const { scene } = this
    const isLoaded = scene && [scene.model, ...scene.ground].every((address) => this.assets.has(address))
    this.forget()
    this.replaced = this.world
    this.isReplaced = false
    this.world = isLoaded ? new World(scene, this.assets, this.profile) : null
    if (!this.world) return
    this.world.scene.add(this.scan.group, this.trailView.mesh, this.drawingView.mesh, this.overlayView.group)
    this.world.height = this.canvas.clientHeight * (this.renderer?.ratio ?? 1)
    this.changedAt = performance.now() / 1000
    this.choice.restart(this.changedAt)
  }

  /** Frees the World before, and what only it had. */
  private forget(): void {
    if (!this.replaced) return
    this.replaced.dispose()
    this.replaced = null
    for (const asset of this.dropped.splice(0)) release(asset)
  }

  private setQuality(): void {
    const quality = this.store.quality.value
    if (quality !== 'stream' && !this.canDraw) this.store.warning.value = NO_WEBGL
    if (quality === 'stream') this.startStream()
    else this.store.isStreamStarting.value = false // its last image stays until the page has drawn one
    const profile = this.choice.profile(quality)
    this.choice.restart(performance.now() / 1000)
    if (quality === 'stream' || profile === this.profile) return
    this.profile = profile
    this.build()
    this.resize()
  }

  /** Whether the page can draw the scene itself. */
  private get canDraw(): boolean {
    return this.renderer !== null && !this.isContextLost
  }

  /** Whether images of the simulator are shown. */
  private get isStreamed(): boolean {
    return this.isStreamWanted && this.remote.hasImage
  }

  private get isStreamWanted(): boolean {
    return this.store.quality.value === 'stream' && !this.store.isStreamPaused.value
  }

  /** The page draws the map itself while it is viewed or turns, if it can: the simulator does not have that camera. */
  private pauseStream(): void {
    const { store } = this
    const isPaused = (store.isMapViewed || store.isTurning.value) && this.canDraw
    if (isPaused === store.isStreamPaused.value) return
    store.isStreamPaused.value = isPaused
    if (isPaused) this.remote.hide()
    if (store.quality.value === 'stream') this.startStream()
  }

  private startStream(): void {
    this.remote.start()
    this.store.isStreamStarting.value = !this.store.isStreamPaused.value
  }

  /** An image shows the present Scene. */
  private showed(): void {
    if (this.store.shownScene.value !== this.scene) this.store.shownScene.value = this.scene
  }

  private countStreamed(): void {
    this.showed()
    this.images++
    if (this.store.isStreamStarting.value) this.store.isStreamStarting.value = false
  }

  private useRemoteView(notice: string): void {
    this.store.warning.value = notice
    this.store.fallbackQuality = 'stream'
    this.store.quality.value = 'stream'
  }

  private zoom(event: WheelEvent): void {
    if (this.store.isMapViewed) return // the camera of Edit mode zooms
    event.preventDefault()
    event.stopImmediatePropagation()
    const { store } = this
    // Bird's Eye moves in whole steps
    this.turned += wheelClicks(event)
    const clicks = store.camera.value === "Bird's Eye" ? Math.trunc(this.turned) : this.turned
    this.turned -= clicks
    if (clicks !== 0) zoomCamera(store, clicks)
  }

  // -- drawing ---------------------------------------------------------------------------------------------------

  private readonly drawFrame = (milliseconds: number): void => {
    this.animation = requestAnimationFrame(this.drawFrame)
    if (this.renderer?.isBusy) return
    const now = milliseconds / 1000
    const dt = Math.max(0, now - this.before)
    const isWaiting = this.isStreamWanted && !this.remote.hasImage
    if (isWaiting && dt < WAITING_PERIOD) return
    const wasDrawn = this.before === this.drawnAt
    this.before = now
    if (document.hidden) return
    this.count(now)
    if (wasDrawn) this.took = dt
    if (this.render(now, Math.min(dt, 0.25))) {
      this.drawnAt = now
      if (this.isStreamWanted) this.remote.uncover()
      else this.remote.hide()
      const isJudged = this.store.quality.value === 'auto' && !this.store.isTurning.value
      if (wasDrawn && isJudged) this.judge(dt, now)
    }
    this.store.imageCount.value += 1
  }

  /** Whether the next image would be another one than the latest; true if a vehicle of a running simulator is followed. */
  private isNew(now: number): boolean {
    const { isMapViewed, isTurning, link } = this.store
    const isStarting = link.value === 'starting'
    const rest = isStarting ? STARTING_REST : 2
    const pause = this.took > SLOW_IMAGE ? rest * this.took : 0
    if (!isMapViewed) return !(isTurning.value || isStarting) || now >= this.drawnAt + pause
    if (this.isReplaced) return false
    if (this.changedAt >= this.drawnAt) return true
    const { matrixWorld, projectionMatrix } = this.viewpoints.camera
    if (![matrixWorld, projectionMatrix].every((one, i) => isSame(one, this.drawnFrom[i]))) return true
    return now < this.movedAt + SETTLING && now >= this.drawnAt + pause
  }

  /** Moves cameras, scan, labels and driven lines, and draws; returns whether an image was drawn. */
  private render(now: number, dt: number): boolean {
    const { renderer, world, scene, store, motion, viewpoints } = this
    if (!scene || motion.isEmpty) return false
    const isStream = this.isStreamed
    const state = isStream ? motion.at(this.remote.time) : motion.advance(performance.now() / 1000)
    const followed = state.vehicles.has(store.vehicle.value) ? store.vehicle.value : [...state.vehicles.keys()][0]
    const vehicle = state.vehicles.get(followed)
    if (!vehicle) return false
    const spec = scene.vehicles[followed]
    const zoom = lensZoomOf(store) * (isStream ? Math.max(1, viewpoints.camera.aspect / STREAM_ASPECT) : 1)
    // the simulator, which draws the images of Stream, has no such limit
    const freeShare = isStream || !world ? undefined : world.freeShare.bind(world)
    const view = { height: store.birdHeight.value, halfLength: spec.half_length, zoom, freeShare }
    if (store.isTurning.value && !store.isMapViewed) viewpoints.turn(scene, dt)
    else viewpoints.update(store.camera.value, scene, vehicle, dt, view)
    if (store.isMapViewed && !isStream) {
      viewpoints.controls.enabled = false
      this.editCamera.update(viewpoints.camera, vehicle.position, store.isBuilding.value ? BUILD_DISTANCE : 1)
      showPreview(state, store.preview.value, scene)
    } else this.editCamera.close()
    up.set(0, 1, 0).applyQuaternion(viewpoints.camera.quaternion)
    this.labels.update(state.vehicles, store.areLabelsShown.value, {
      ...{ viewed: followed, pointer: this.pointer, eye: viewpoints.camera.position, up },
      isOwnHidden: store.camera.value === "Driver's Eye" && !store.isMapViewed,
      isFarShown: store.isMapViewed,
      project: (x, y, z) => this.screenPoint(x, y, z),
    })
    if (isStream || !renderer || !world || !this.isNew(now)) return false
    for (const [i, one] of [viewpoints.camera.matrixWorld, viewpoints.camera.projectionMatrix].entries())
      this.drawnFrom[i].copy(one)
    const scan = store.isScanShown.value ? (store.scans.get(followed) ?? null) : null
    this.scan.show(scan, followed, spec, motion)
    this.trailView.update(scene, this.trails, store.areTrailsShown.value, state.isDay)
    this.drawingView.update(store)
    this.overlayView.update(store, state, vehicle, viewpoints.camera)
    // light to work by in Edit and Build mode; the simulation stays as dark as it is
    const isDark = store.isMapViewed && !isBright(scene.light_table, state.isDay, state.timeOfDay)
    const seen = isDark ? { ...state, isDay: true, timeOfDay: null } : state
    this.draw = () => renderer.render(world, viewpoints.camera, seen, followed, 0)
    renderer.render(world, viewpoints.camera, seen, followed, dt)
    this.forget()
    this.showed()
    this.images++
    return now > 0
  }

  private count(now: number): void {
    if (now - this.counted < 0.5) return
    this.store.frameRate.value = this.images / (now - this.counted)
    this.counted = now
    this.images = 0
  }

  private judge(duration: number, now: number): void {
    const verdict = this.choice.measure(duration, now)
    if (verdict === 'too-slow') this.useRemoteView(TOO_SLOW)
    else if (verdict === 'change') this.setQuality()
  }
}

/** Whether two cameras draw the same image: the controls of the camera compute it again each time, with rounding. */
function isSame(a: Matrix4, b: Matrix4): boolean {
  return a.elements.every((value, i) => Math.abs(value - b.elements[i]) < 1e-9)
}

const point = new Vector3()
const up = new Vector3()
