// The LIDAR's scan seen from above: the sensor in the middle, the vehicle's heading up, rings with their distance.
import type { LidarScan, Pose } from '../messages'
import { fit, watchColours } from './colours'
import { h, setText } from './element'
import { fixed, nearestRay, presentRay } from './hud_rows'
import type { Moment } from './hud_rows'
import { recall, remember } from './memory'
import { niceStep } from './scales'

export interface Polar {
  element: HTMLElement
  /** What the person may press to change the scale. */
  toggle: HTMLButtonElement
  /** Where the nearest return is told. */
  nearest: HTMLElement
  refresh: (moment: Moment) => void
}

const NAMES = ['scan', 'scan-fill', 'grid', 'muted', 'surface', 'text', 'plot-2'] as const
type Context = CanvasRenderingContext2D
type Colours = Record<(typeof NAMES)[number], string>

/** Between the outermost ring and the edge [px]. */
const MARGIN = 4
/** The scale shrinks after so long a time without farther returns [ms], so that it does not jump about. */
const PATIENCE = 1500

/** Distance [m] -> share of the outermost ring's radius. */
type Scale = (distance: number) => number

export function polar(): Polar {
  const canvas = h('canvas', { class: 'polar-canvas', role: 'img', 'aria-label': 'LIDAR scan from above, heading up' })
  const toggle = h('button', { class: 'quiet', testid: 'hud-polar-scale', onclick: () => turn(!isLog) })
  const nearest = h('dd', { class: 'nearest', testid: 'hud-nearest' })
  let isLog = recall('polar') === 'log'
  let colours: Colours | null = null
  let reach = 1
  let patience = 0
  const turn = (value: boolean) => {
    isLog = value
    remember('polar', isLog ? 'log' : 'linear')
    setText(toggle, isLog ? 'Log' : 'Linear')
    const names = isLog ? (['logarithmic', 'linear'] as const) : (['linear', 'logarithmic'] as const)
    toggle.title = `Rings with ${names[0]} distance; press for ${names[1]}`
  }
  turn(isLog)
  watchColours(NAMES, (now) => (colours = now))

  /** How far the plot reaches [m]: grows at once, shrinks after a while. */
  const adapt = (scan: LidarScan): number => {
    let farthest = scan.range_min
    for (const range of scan.ranges) if (Number.isFinite(range) && range > farthest) farthest = range
    const wanted = roundReach(Math.max(farthest, 0.4))
    if (wanted >= reach) patience = performance.now() + PATIENCE
    if (wanted > reach || performance.now() > patience) reach = wanted
    return reach
  }

  return {
    element: h('div', { class: 'polar', testid: 'hud-polar' }, canvas),
    toggle,
    nearest,
    refresh({ frame, scan, scene }) {
      const paper = fit(canvas)
      setText(nearest, scan ? bearing(scan, scene?.lidar ?? null) : '–')
      if (!paper || !colours) return
      const { context, width, height } = paper
      const radius = Math.min(width, height) / 2 - MARGIN
      context.translate(width / 2, height / 2)
      const least = scan ? Math.max(scan.range_min, 0.01) / 1.5 : 0.1
      const far = !scan ? reach : isLog && Number.isFinite(scan.range_max) ? scan.range_max : adapt(scan)
      const span = Math.log(far / least)
      const scale: Scale = isLog
        ? (distance) => Math.max(0, Math.log(distance / least) / span)
        : (distance) => distance / far
      const rings = isLog ? decades(least, far) : evenly(far)
      drawRings(context, rings, scale, radius, colours)
      if (scan) drawScan(context, scan, yawOf(scene?.lidar ?? null), scale, radius, frame?.time ?? scan.time, colours)
      drawNumbers(context, rings, scale, radius, colours)
      drawCar(context, colours)
    },
  }
}

function drawRings(context: Context, rings: number[], scale: Scale, radius: number, colours: Colours) {
  context.lineWidth = 1
  context.strokeStyle = colours.grid
  context.beginPath()
  for (const ring of rings) {
    context.moveTo(scale(ring) * radius, 0)
    context.arc(0, 0, scale(ring) * radius, 0, 2 * Math.PI)
  }
  for (const [x, y] of [[1, 0], [0, 1]] as const) {
    context.moveTo(-x * radius, -y * radius)
    context.lineTo(x * radius, y * radius)
  }
  context.stroke()
}

/** Numbers of the rings, above the scan. */
function drawNumbers(context: Context, rings: number[], scale: Scale, radius: number, colours: Colours) {
  context.font = '10.5px system-ui, sans-serif'
  context.textAlign = 'center'
  context.textBaseline = 'middle'
  for (const ring of rings) {
    const at = scale(ring) * radius * Math.SQRT1_2
    if (at < 14) continue // the arrow is there
    const text = String(Number(ring.toPrecision(2)))
    context.lineWidth = 3
    context.strokeStyle = colours.surface
    context.fillStyle = colours.muted
    context.strokeText(text, at, at)
    context.fillText(text, at, at)
  }
}

function drawScan(
  context: Context,
  scan: LidarScan,
  yaw: number,
  scale: Scale,
  radius: number,
  time: number,
  colours: Colours,
) {
  const place = (ray: number): [number, number] => {
    const angle = scan.angle_min + ray * scan.angle_increment + yaw
    const distance = Math.min(scale(scan.ranges[ray]!), 1) * radius
    return [-Math.sin(angle) * distance, -Math.cos(angle) * distance]
  }
  const isSeen = (ray: number) => Number.isFinite(scan.ranges[ray])
  const count = scan.ranges.length

  // What is free: from the sensor to each return; a sector without one stays empty.
  context.fillStyle = colours['scan-fill']
  context.beginPath()
  for (let ray = 0; ray < count; ray++) {
    if (!isSeen(ray)) continue
    const half = scan.angle_increment / 2
    const angle = -Math.PI / 2 - (scan.angle_min + ray * scan.angle_increment + yaw)
    context.moveTo(0, 0)
    context.arc(0, 0, Math.min(scale(scan.ranges[ray]!), 1) * radius, angle - half, angle + half)
  }
  context.fill()

  context.fillStyle = colours.scan
  for (let ray = 0; ray < count; ray++) {
    if (!isSeen(ray)) continue
    const [x, y] = place(ray)
    context.fillRect(x - 1, y - 1, 2, 2)
  }

  const present = presentRay(scan, time)
  if (!isSeen(present)) return
  const [x, y] = place(present)
  context.strokeStyle = context.fillStyle = colours['plot-2']
  context.lineWidth = 1
  context.beginPath()
  context.moveTo(0, 0)
  context.lineTo(x, y)
  context.stroke()
  context.beginPath()
  context.arc(x, y, 3, 0, 2 * Math.PI)
  context.fill()
}

/** An arrow head where the sensor is: its place, not the vehicle's size, which a logarithm would distort. */
function drawCar(context: Context, colours: Colours) {
  context.fillStyle = colours.text
  context.beginPath()
  context.moveTo(0, -7)
  context.lineTo(5, 6)
  context.lineTo(0, 3.2)
  context.lineTo(-5, 6)
  context.fill()
}

/** Reaches that divide into so many round rings; and their tenths and tens. */
const REACHES: readonly [reach: number, rings: number][] = [
  [1, 4], [1.2, 4], [1.6, 4], [2, 4], [3, 3], [4, 4], [5, 5], [6, 3], [8, 4], [10, 4],
]

/** The least of them that is not less than that distance [m]. */
function roundReach(farthest: number): number {
  const power = 10 ** Math.floor(Math.log10(farthest))
  return (REACHES.find(([reach]) => reach * power >= farthest) ?? REACHES[0]!)[0] * power
}

function evenly(far: number): number[] {
  const mantissa = far / 10 ** Math.floor(Math.log10(far) + 1e-9)
  const rings = REACHES.find(([reach]) => Math.abs(reach - mantissa) < 1e-6)?.[1] ?? 4
  return Array.from({ length: rings }, (_, i) => ((i + 1) * far) / rings)
}

/** 1, 2, 5 and their tenths and tens between the two. */
function decades(least: number, far: number): number[] {
  const rings: number[] = []
  for (let ring = niceStep(least * 1.3); ring < far * 0.7; ring = niceStep(ring * 1.5)) rings.push(ring)
  return [...rings, far]
}

/** Heading of the scan's axes in the vehicle [rad]. */
function yawOf(lidar: Pose | null): number {
  const [w = 1, x = 0, y = 0, z = 0] = lidar?.orientation ?? []
  return Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
}

/** Distance, and below it the direction: "0.42 m\n35° left". */
function bearing(scan: LidarScan, lidar: Pose | null): string {
  const ray = nearestRay(scan)
  if (ray < 0) return 'inf m'
  const turn = scan.angle_min + ray * scan.angle_increment + yawOf(lidar)
  const degrees = Math.round((Math.atan2(Math.sin(turn), Math.cos(turn)) * 180) / Math.PI)
  const side = degrees === 0 || Math.abs(degrees) === 180 ? '' : degrees > 0 ? ' left' : ' right'
  return `${fixed(scan.ranges[ray])} m\n${Math.abs(degrees)}°${side}`
}
