import { BoxGeometry, Matrix4, Mesh, type Points, Quaternion, Vector3 } from 'three'
import { describe, expect, test } from 'vitest'

import type { Frame, LidarScan } from '../src/messages'
import { Headlights, TailLights } from '../src/messages'
import { Observable } from '../src/observable'
import { flown, flownNearer } from '../src/scene/flight'
import type { Node, Vector } from '../src/scene/glb'
import { LAMPS, lampBrightness } from '../src/scene/lamps'
import { MotionInterpolator } from '../src/scene/motion'
import { isSoftware, PROFILES, QualityChoice } from '../src/scene/quality'
import { ScanView } from '../src/scene/scan'
import { depthMaterial, Shadows, sunAxes } from '../src/scene/shadows'
import { Skeleton } from '../src/scene/skeleton'
import { TURBO } from '../src/scene/turbo'
import { VehicleModel } from '../src/scene/vehicle'
import { Viewpoints } from '../src/scene/viewpoints'
import { heightAfter, ORBIT_DISTANCE, wheelClicks, zoomCamera } from '../src/scene/zoom'
import { type Fly, Store } from '../src/store'
import { frameOf, pose, sceneOf, vehicleOf } from './support'

/** A vehicle at x [m] with that yaw [rad], driving forward at 1 m/s. */
function at(time: number, x: number, yaw = 0, values = {}): Frame {
  const vehicle = vehicleOf({ pose: pose(x, 0, yaw), velocity: new Float64Array([1, 0, 0]), ...values })
  return frameOf([], { time, vehicles: { V1: vehicle } })
}

/** Plays Frames of 1 m/s at 50 Hz in real time, drawn at 100 Hz; returns x at each image. */
function drive(motion: MotionInterpolator, seconds: number, jitter: (i: number) => number = () => 0): number[] {
  const shown: number[] = []
  let next = 0
  for (let image = 0; image < seconds * 100; image++) {
    const now = image / 100
    while (next / 50 + jitter(next) <= now) motion.add(at(next / 50, next++ / 50), now)
    const vehicle = motion.advance(now).vehicles.get('V1')
    if (vehicle) shown.push(vehicle.position.x)
  }
  return shown
}

describe('motion interpolation', () => {
  test('the speed between images is constant', () => {
    const shown = drive(new MotionInterpolator(), 4).slice(200)
    const steps = shown.slice(1).map((x, i) => x - shown[i])
    for (const step of steps) expect(step).toBeCloseTo(0.01, 3)
  })

  test('uneven arrivals do not stop or reverse the motion', () => {
    const shown = drive(new MotionInterpolator(), 4, (i) => (i % 3) * 0.012).slice(200)
    const steps = shown.slice(1).map((x, i) => x - shown[i])
    expect(Math.min(...steps)).toBeGreaterThan(0.004)
    expect(Math.max(...steps)).toBeLessThan(0.016)
  })

  test('the delay is a few intervals', () => {
    const shown = drive(new MotionInterpolator(), 4)
    expect(shown[shown.length - 1]).toBeGreaterThan(4 - 0.1)
    expect(shown[shown.length - 1]).toBeLessThanOrEqual(4)
  })

  test('it never shows a time after the latest Frame, and stands still in a pause', () => {
    const motion = new MotionInterpolator()
    drive(motion, 2)
    const [a, b] = [3, 4].map((now) => motion.advance(now).vehicles.get('V1')?.position.x)
    expect(a).toBeCloseTo(1.98)
    expect(b).toBe(a)
  })

  test('a teleport is not interpolated', () => {
    const motion = new MotionInterpolator()
    motion.add(at(0, 0), 0)
    motion.add(at(0.02, 5), 0.02)
    expect(motion.poseAt('V1', 0.01, { position: new Vector3(), orientation: new Quaternion() })?.position.x).toBe(2.5)
    for (let now = 0.02; now < 0.2; now += 0.01) {
      const x = motion.advance(now).vehicles.get('V1')?.position.x
      expect(x === 0 || x === 5).toBe(true)
    }
  })

  test('a reset restarts at the earlier time', () => {
    const motion = new MotionInterpolator()
    drive(motion, 1)
    motion.add(at(0, 0), 1.01)
    expect(motion.advance(1.02).vehicles.get('V1')?.position.x).toBe(0)
  })

  test('orientation takes the shorter way', () => {
    const motion = new MotionInterpolator()
    motion.add(at(0, 0, 3.1), 0)
    motion.add(at(1, 0, -3.1), 1)
    const placed = motion.poseAt('V1', 0.5, { position: new Vector3(), orientation: new Quaternion() })
    const ahead = new Vector3(1, 0, 0).applyQuaternion(placed?.orientation ?? new Quaternion())
    expect(ahead.x).toBeCloseTo(-1)
  })

  test('a wheel turns on by its speed when its angle wraps', () => {
    const wheels = (angle: number) => ({
      ...vehicleOf().wheels,
      rotation_angle: new Float64Array(4).fill(angle),
      angular_velocity: new Float64Array(4).fill(20),
    })
    const motion = new MotionInterpolator()
    motion.add(at(0, 0, 0, { wheels: wheels(6) }), 0)
    motion.advance(0.09)
    motion.add(at(0.1, 0.01, 0, { wheels: wheels(8 - 2 * Math.PI) }), 0.1)
    const angles: number[] = []
    for (let now = 0.1; now < 1; now += 0.005) angles.push(motion.advance(now).vehicles.get('V1')?.spin[0] ?? NaN)
    const turns = angles.slice(1).map((angle, i) => Math.sin(angle - angles[i])) // whole turns do not matter
    expect(Math.min(...turns)).toBeGreaterThanOrEqual(-1e-9)
    expect(turns.reduce((sum, turn) => sum + turn)).toBeGreaterThan(1.7) // 2 rad, without the first image
  })

  test('unknown vehicles have no pose', () => {
    const placed = { position: new Vector3(), orientation: new Quaternion() }
    expect(new MotionInterpolator().poseAt('V1', 0, placed)).toBeNull()
  })
})

describe('quality', () => {
  function measure(choice: QualityChoice, duration: number, seconds: number, start: number) {
    for (let now = start; now < start + seconds; now += duration) {
      const result = choice.measure(duration, now)
      if (result !== 'stay') return { result, now }
    }
    return { result: 'stay', now: start + seconds }
  }

  test('software renderers start with the light profile, graphics cards with the high one', () => {
    expect(isSoftware('ANGLE (Google, Vulkan (SwiftShader Device), SwiftShader driver)')).toBe(true)
    expect(isSoftware('llvmpipe (LLVM 15.0.6, 256 bits)')).toBe(true)
    expect(isSoftware('NVIDIA GeForce RTX 3060/PCIe/SSE2')).toBe(false)
    expect(new QualityChoice(true).profile('auto').name).toBe('light')
    expect(new QualityChoice(false).profile('auto').name).toBe('high')
  })

  test('a choice of the user is kept; low is light in software', () => {
    expect(new QualityChoice(true).profile('low').name).toBe('light')
    expect(new QualityChoice(false).profile('low').name).toBe('low')
    expect(new QualityChoice(true).profile('ultra').name).toBe('ultra')
  })

  test('slow frames lower the profile step by step, then the simulator renders', () => {
    const choice = new QualityChoice(false)
    const first = measure(choice, 0.2, 10, 0)
    expect([first.result, choice.profile('auto').name]).toEqual(['change', 'low'])
    const second = measure(choice, 0.2, 10, first.now)
    expect([second.result, choice.profile('auto').name]).toEqual(['change', 'light'])
    expect(measure(choice, 0.2, 10, second.now).result).toBe('too-slow')
  })

  test('fast frames raise the profile once, after a minute', () => {
    const choice = new QualityChoice(false)
    const lowered = measure(choice, 0.05, 10, 0)
    const raised = measure(choice, 0.01, 100, lowered.now)
    expect([raised.result, choice.profile('auto').name]).toEqual(['change', 'high'])
    expect(raised.now - lowered.now).toBeGreaterThan(59)
    const again = measure(choice, 0.05, 10, raised.now)
    expect(measure(choice, 0.01, 200, again.now).result).toBe('stay')
  })

  test('one slow frame is not enough', () => {
    const choice = new QualityChoice(false)
    choice.restart(0)
    choice.measure(2, 2)
    expect(measure(choice, 0.01, 10, 2).result).toBe('stay')
  })
})

describe('lamps', () => {
  test('have the brightness of the state of the vehicle', () => {
    const brightness = new Float32Array(LAMPS.length)
    const { lights } = vehicleOf()
    const on = (values: object) => {
      lampBrightness({ ...lights, ...values }, brightness)
      return LAMPS.filter((_, i) => brightness[i] > 0)
    }
    expect(on({})).toEqual([])
    expect(on({ headlights: Headlights.LOW })).toEqual(['head_left', 'head_right'])
    expect(on({ headlights: Headlights.HIGH }).length).toBe(4)
    expect(on({ left_indicator: true })).toEqual(['front_indicator_left', 'rear_indicator_left'])
    expect(on({ tail_lights: TailLights.PARTIAL })).toEqual(['tail_left', 'tail_right'])
    expect(brightness[LAMPS.indexOf('tail_left')]).toBe(0.5)
    expect(on({ reverse_lights: true })).toEqual(['reverse_left', 'reverse_right'])
  })
})

describe('the skeleton', () => {
  const node = (values: object) => ({
    ...{ name: '', parent: -1, lamp: '', joint: null, surfaces: {} },
    ...{
      position: [0, 0, 0] as [number, number, number],
      orientation: [0, 0, 0, 1] as [number, number, number, number],
    },
    ...values,
  })
  const joint = (kind: 'hinge' | 'slide', signal: string, axis: [number, number, number]) => ({
    ...{ kind, signal, axis, gain: 1, arm: [0, 0, 0] as [number, number, number] },
  })

  test('moves children with their parents', () => {
    const skeleton = new Skeleton([
      node({}),
      node({ parent: 0, position: [1, 0, 0], joint: joint('hinge', 'steering', [0, 0, 1]) }),
      node({ parent: 1, position: [1, 0, 0] }),
      node({ parent: 1, joint: joint('slide', 'compression', [0, 0, 1]) }),
    ])
    expect(skeleton.boneOf).toEqual([0, 1, 1, 2])
    const poses = new Float32Array(16 * 3)
    skeleton.pose(new Matrix4().makeTranslation(0, 0, 5), { steering: Math.PI / 2, compression: 0.25 }, poses)
    const wheel = new Vector3(1, 0, 0).applyMatrix4(new Matrix4().fromArray(poses, 16))
    expect(wheel.toArray()).toEqual([expect.closeTo(1), expect.closeTo(1), expect.closeTo(5)])
    const slide = new Vector3().applyMatrix4(new Matrix4().fromArray(poses, 32))
    expect(slide.toArray()).toEqual([expect.closeTo(1), expect.closeTo(0), expect.closeTo(5.25)])
  })

  test('has a maximum number of bones', () => {
    const nodes = Array.from({ length: 30 }, () => node({ joint: joint('slide', 'x', [1, 0, 0]) }))
    expect(() => new Skeleton(nodes)).toThrow('the maximum is 24')
  })
})

describe('the colours of a scan', () => {
  /** Where the colours end after these scans, each of one range [m]. */
  function ends(...scans: number[]): number[] {
    const motion = new MotionInterpolator()
    drive(motion, 1)
    const farthest = new Observable(0)
    const view = new ScanView(farthest)
    return scans.map((range) => {
      const scan = { time: 0.9, ranges: Float32Array.from([0.09, range]), angle_min: 0, angle_increment: 1 }
      view.show(
        { ...scan, scan_time: 0.1, time_increment: 0 } as unknown as LidarScan,
        'V1',
        { lidar: pose(), is_lidar_level: false },
        motion,
      )
      return farthest.value
    })
  }

  test('end at a round distance beyond all points, which seldom changes', () => {
    expect(ends(3.2, 4.9, 2.1, 5.1, 4, 3.4, 0.9)).toEqual([5, 5, 5, 10, 10, 5, 1])
    expect(ends(Infinity)).toEqual([0.1].map((one) => expect.closeTo(one)))
  })

  test('are those of turbo, which is brightest in the middle and dark at both ends', () => {
    const brightness = TURBO.map(([red, green, blue]) => 0.3 * red + 0.6 * green + 0.1 * blue)
    const top = brightness.indexOf(Math.max(...brightness))
    expect(Math.abs(top - (TURBO.length - 1) / 2)).toBeLessThanOrEqual(1)
    expect(brightness.slice(0, top)).toEqual(brightness.slice(0, top).sort((a, b) => a - b))
    expect(brightness.slice(top)).toEqual(brightness.slice(top).sort((a, b) => b - a))
  })
})

describe('the fan of a scan', () => {
  /** Number of triangles that the fan of a scan at rest draws. */
  function triangles(ranges: number[], increment: number): number {
    const motion = new MotionInterpolator()
    drive(motion, 1)
    const view = new ScanView(new Observable(0))
    const scan = { time: 0.9, ranges: Float32Array.from(ranges), angle_min: 0, angle_increment: increment }
    const whole = { ...scan, scan_time: 0.1, time_increment: 0 } as unknown as LidarScan
    view.show(whole, 'V1', { lidar: pose(), is_lidar_level: false }, motion)
    return (view.group.children[0] as Mesh).geometry.drawRange.count / 3
  }

  test('is closed between the last and the first ray of a circle', () => {
    expect(triangles([1, 1, 1, 1], Math.PI / 2)).toBe(4)
  })

  test('is open where a ray hits nothing, and for a part of a circle', () => {
    expect(triangles([1, 1, 1, Infinity], Math.PI / 2)).toBe(2)
    expect(triangles([Infinity, 1, 1, 1], Math.PI / 2)).toBe(2)
    expect(triangles([1, 1, 1, 1], Math.PI / 4)).toBe(3)
  })
})

test('the points of a level scan are at the height of the LIDAR of a pitched car', () => {
  const orientation = new Float64Array([Math.cos(0.1), 0, Math.sin(0.1), 0])
  const pitched = { pose: { position: new Float64Array([0, 0, 0.1]), orientation } }
  const motion = new MotionInterpolator()
  for (const time of [0, 0.02, 0.04]) motion.add(at(time, 0, 0, pitched), time)
  const scan = { time: 0.02, ranges: Float32Array.from([2]), angle_min: 0, angle_increment: 1, scan_time: 0.1 }
  const [level, tilted] = [true, false].map((is_lidar_level) => {
    const view = new ScanView(new Observable(0))
    const spec = { lidar: pose(), is_lidar_level }
    view.show({ ...scan, time_increment: 0 } as unknown as LidarScan, 'V1', spec, motion)
    return (view.group.children[1] as Points).geometry.getAttribute('position').getZ(0)
  })
  expect(level).toBeCloseTo(0.1, 5)
  expect(tilted).toBeCloseTo(0.1 - 2 * Math.sin(0.2), 5)
})

describe('the fly camera', () => {
  const still = { ahead: 0, left: 0, up: 0, turn: 0, tilt: 0, isFast: false }
  const start = { x: 1, y: 2, z: 3, azimuth: Math.PI / 2, elevation: -Math.PI / 6 }

  test('moves along its own axes, and upwards along z', () => {
    const ahead = flown(start, { ...still, ahead: 1 }, 2)
    const way = Math.hypot(ahead.x - 1, ahead.y - 2, ahead.z - 3)
    expect(ahead.x).toBeCloseTo(1)
    expect((ahead.y - 2) / way).toBeCloseTo(Math.cos(Math.PI / 6))
    expect((ahead.z - 3) / way).toBeCloseTo(-0.5)
    const left = flown(start, { ...still, left: 1 }, 2)
    expect([left.x, left.y, left.z]).toEqual([expect.closeTo(1 - way), expect.closeTo(2), 3])
    const up = flown(start, { ...still, up: -1 }, 0.1)
    expect([up.x, up.y, up.z]).toEqual([1, 2, expect.closeTo(3 - 0.05 * way)])
    expect(flown(start, still, 2)).toBe(start)
  })

  test('two steps of half the time are one, and Shift is faster', () => {
    const input = { ...still, ahead: 1, left: -1, up: 0.5 }
    const once = flown(start, input, 0.4)
    expect(flown(flown(start, input, 0.2), input, 0.2)).toEqual({
      ...once,
      ...{ x: expect.closeTo(once.x), y: expect.closeTo(once.y), z: expect.closeTo(once.z) },
    })
    const [slow, fast] = [false, true].map((isFast) => flown(start, { ...still, left: 1, isFast }, 0.1).x - 1)
    expect(fast / slow).toBeGreaterThan(2)
  })

  test('flies the same arc at any rate of images: a circle of the speed divided by the rate of turning', () => {
    const begin = { x: 0, y: 0, z: 3, azimuth: 0, elevation: 0 }
    const radius = flown(begin, { ...still, ahead: 1 }, 1).x / flown(begin, { ...still, turn: 1 }, 1).azimuth
    for (const rate of [5, 60]) {
      let fly: Fly = begin
      for (let image = 0; image < 2 * rate; image++) fly = flown(fly, { ...still, ahead: 1, turn: 1 }, 1 / rate)
      // chords of 0.24 rad are shorter than their arcs by a share of 0.24^2 / 24
      expect(Math.abs(fly.x - radius * Math.sin(fly.azimuth))).toBeLessThan(0.006 * radius)
      expect(Math.abs(fly.y - radius * (1 - Math.cos(fly.azimuth)))).toBeLessThan(0.006 * radius)
    }
  })

  test('stays above the ground, in the map, and does not turn over', () => {
    const lost = flown(start, { ...still, up: -1, tilt: 1, turn: 1, left: 1 }, 1e6)
    expect(lost.z).toBeGreaterThan(0)
    expect(lost.elevation).toBeLessThan(Math.PI / 2)
    expect(Math.abs(lost.azimuth)).toBeLessThanOrEqual(Math.PI)
    expect(Math.max(Math.abs(lost.x), Math.abs(lost.y))).toBeLessThanOrEqual(1000)
  })

  test('the mouse wheel moves it ahead', () => {
    const { x, y, z } = flownNearer(start, 1)
    expect([x > 0.99, y > 2, z < 3]).toEqual([true, true, true])
    const back = flownNearer(flownNearer(start, 3), -3)
    expect([back.x, back.y, back.z]).toEqual([1, 2, 3].map((one) => expect.closeTo(one)))
  })
})

describe('the orbit', () => {
  const TURN = 1
  const PIXELS = 600

  /** The azimuth [rad] at these times [s] after a drag of `TURN`, drawn at that rate [Hz]. */
  function turned(rate: number, times: readonly number[]): number[] {
    const canvas = document.createElement('canvas')
    Object.defineProperty(canvas, 'clientHeight', { value: PIXELS })
    document.body.append(canvas)
    canvas.setPointerCapture = canvas.releasePointerCapture = () => {}
    const store = new Store()
    const start = { azimuth: 0.5, elevation: 0.4, distance: 2 }
    store.orbit.value = start
    const viewpoints = new Viewpoints(canvas, store)
    const vehicle = { position: new Vector3(1, 2, 0), orientation: new Quaternion() }
    const draw = (dt: number) =>
      viewpoints.update('Orbit', sceneOf(['V1']), vehicle, dt, { height: 3, halfLength: 0.2, zoom: 1 })
    draw(0) // no time has passed: what the drag turns is left as a whole
    const drag = (type: string, x: number) =>
      canvas.dispatchEvent(new PointerEvent(type, { pointerType: 'mouse', bubbles: true, clientX: x }))
    drag('pointerdown', 0)
    drag('pointermove', (-TURN * PIXELS) / (2 * Math.PI))
    drag('pointerup', (-TURN * PIXELS) / (2 * Math.PI))
    const after: number[] = []
    for (let image = 1; after.length < times.length; image++) {
      draw(1 / rate)
      if (image / rate > times[after.length] - 1e-9) after.push((store.orbit.value?.azimuth ?? NaN) - start.azimuth)
    }
    viewpoints.dispose()
    canvas.remove()
    return after
  }

  test.each([5, 20, 60, 240])('eases by time: half of a movement is left after 0.09 s, at %i images/s', (rate) => {
    const times = [0.2, 0.4, 1, 8]
    const left = turned(rate, times).map((azimuth) => 1 - azimuth / TURN)
    expect(left).toEqual(times.map((time) => expect.closeTo(0.5 ** (time / 0.09), 4)))
  })
})

describe('the orbit beside a wall', () => {
  test('stays before the wall, and returns to its distance beyond it', () => {
    const shadows = new Shadows(PROFILES.light, sunAxes([0, 0.6, 0.8]), 0.8, 0.3)
    const wall = new Mesh(new BoxGeometry(0.1, 4, 1), depthMaterial(null))
    wall.position.set(-1, 0, 0.5)
    wall.updateMatrixWorld()
    shadows.staticScene.add(wall)
    const store = new Store()
    const viewpoints = new Viewpoints(document.createElement('canvas'), store)
    const [level, above] = [0.02, 1.4].map((elevation) => {
      store.orbit.value = { azimuth: Math.PI, elevation, distance: 3 }
      const vehicle = { position: new Vector3(), orientation: new Quaternion() }
      const freeShare = shadows.freeShare.bind(shadows)
      viewpoints.update('Orbit', sceneOf(['V1']), vehicle, 0, { height: 3, halfLength: 0.2, zoom: 1, freeShare })
      return viewpoints.camera.position.clone()
    })
    expect(level.x).toBeGreaterThan(-0.95)
    expect(level.x).toBeLessThan(-0.85)
    expect(above.distanceTo(viewpoints.controls.target)).toBeCloseTo(3)
    expect(store.orbit.value?.distance).toBeCloseTo(3)
    viewpoints.dispose()
    shadows.dispose()
  })
})

describe('the zoom', () => {
  test("the mouse wheel moves the Bird's Eye in steps, within its limits", () => {
    const scene = sceneOf(['V1'])
    expect(heightAfter(scene, 3, -3)).toBe(3.3)
    expect(heightAfter(scene, 3.3, 3)).toBe(3)
    expect(heightAfter(scene, 9.9, -5)).toBe(10)
    expect(heightAfter(scene, 1.1, 5)).toBe(1)
  })

  test('a wheel event is a number of clicks, up is positive', () => {
    const of = (deltaY: number, deltaMode: number) => wheelClicks({ deltaY, deltaMode } as WheelEvent)
    expect(of(-100, WheelEvent.DOM_DELTA_PIXEL)).toBe(1)
    expect(of(10, WheelEvent.DOM_DELTA_PIXEL)).toBeCloseTo(-0.1)
    expect(of(-3, WheelEvent.DOM_DELTA_LINE)).toBeCloseTo(1)
  })

  test('the other cameras change by the same factor, within limits', () => {
    const store = new Store()
    store.orbit.value = { azimuth: 1, elevation: 0.5, distance: 2 }
    for (const camera of ['Orbit', "Driver's Eye", "God's Eye"] as const) {
      store.camera.value = camera
      zoomCamera(store, 2)
    }
    expect(store.orbit.value).toEqual({ azimuth: 1, elevation: 0.5, distance: expect.closeTo(2 / 1.21) })
    expect(store.lensZoom.value).toEqual({ "Driver's Eye": expect.closeTo(1.21), "God's Eye": expect.closeTo(1.21) })
    store.camera.value = 'Orbit'
    zoomCamera(store, 1000)
    expect(store.orbit.value?.distance).toBe(ORBIT_DISTANCE[0])
  })
})

describe('the shade below vehicles of two sizes', () => {
  test('has the size and the place of each', () => {
    const model = (length: number, width: number) => {
      const corners = [0, 1].flatMap((x) =>
        [-0.5, 0.5].flatMap((y) => [0, 1].flatMap((z) => [x * length, y * width, z])),
      )
      const [positions, normals] = [new Float32Array(corners), new Float32Array(corners.length)]
      const look = { uvs: null, open: null, color: [1, 1, 1] as Vector, isPaint: false, emission: [0, 0, 0] as Vector }
      const surface = { positions, normals, indices: new Uint16Array([0, 1, 2]), ...look }
      const node: Node = {
        ...{ name: 'body', parent: -1, position: [0, 0, 0], orientation: [0, 0, 0, 1], joint: null, lamp: '' },
        surfaces: { shadow: [{ ...surface, roughness: 1, metallic: 0, image: -1 }] },
      }
      return new VehicleModel(
        { nodes: [node], images: [], imageNames: [], clouds: -1, strips: null, extent: null },
        [],
        null,
      )
    }
    const [places, tiles] = [new Float32Array(8), new Float32Array(8)]
    const [long, short] = [model(0.5, 0.3), model(0.25, 0.15)]
    long.root.makeTranslation(2, 0, 0)
    for (const [slot, one] of [long, short].entries()) one.footprint(places, tiles, 4 * slot)
    expect([...places]).toEqual([2.25, 0, 1, 0, 0.125, 0, 1, 0].map((value) => expect.closeTo(value)))
    const half = [0.25, 0.15, 0.125, 0.075].map((value) => 0.92 * value)
    expect([...tiles]).toEqual([0, 0, half[0], half[1], 0, 0, half[2], half[3]].map((value) => expect.closeTo(value)))
  })
})
