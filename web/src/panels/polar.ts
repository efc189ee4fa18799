// A polar plot of the LIDAR scan: sensor in the centre, vehicle heading up, rings labelled with their distance.
import type { LidarScan, Pose } from '../messages'
import { contextOf } from './canvas'
import { watchColours } from './colours'
import { h, setText } from './element'
import type { HudState } from './hud_rows'
import { fixed, nearestRay, rayAt, yawOf } from './hud_rows'
import { loadPreference, savePreference } from './preferences'
import { niceStep } from './scales'

export interface Polar {
  element: HTMLElement
  /** Button that switches between linear and logarithmic scale. */
  toggle: HTMLButtonElement
  /** Element with the nearest return. */
  nearest: HTMLElement
  refresh: (state: HudState) => void
}

const NAMES = ['scan', 'scan-fill', 'grid', 'muted', 'surface', 'text', 'plot-2'] as const
type Context = CanvasRenderingContext2D
type Colours = Record<(typeof NAMES)[number], string>

/** Margin around the outermost ring [px]. */
const MARGIN = 4
/** Time without farther returns after which the scale shrinks [ms], so that it does not flicker. */
const SHRINK_DELAY = 1500

/** Distance [m] -> fraction of the radius of the outermost ring. */
type Scale = (distance: number) => number

/** Calls `choose` with the bearing [rad] that the user selects on the plot. */
export function polar(choose: (bearing: number) => void): Polar {
  const canvas = h('canvas', {
    class: 'polar-canvas',
    role: 'img',
    'aria-label': 'LIDAR scan from above, vehicle heading up',
    onpointerdown: (event: PointerEvent) => {
      canvas.setPointerCapture(event.pointerId)
      point(event)
    },
    onpointermove: (event: PointerEvent) => event.buttons & 1 && point(event),
  })
  const point = ({ clientX, clientY }: PointerEvent) => {
    const { left, top, width, height } = canvas.getBoundingClientRect()
    choose(Math.atan2(left + width / 2 - clientX, top + height / 2 - clientY))
  }
  const toggle = h('button', { class: 'quiet', testid: 'hud-polar-scale', onclick: () => setLog(!isLog) })
  const nearest = h('dd', { class: 'nearest', testid: 'hud-nearest' })
  let isLog = loadPreference('polar') === 'log'
  let colours: Colours | null = null
  let reach = 1
  let shrinkTime = 0
  const setLog = (value: boolean) => {
    isLog = value
    savePreference('polar', isLog ? 'log' : 'linear')
    setText(toggle, isLog ? 'Log' : 'Linear')
    const names = isLog ? (['logarithmic', 'linear'] as const) : (['linear', 'logarithmic'] as const)
    toggle.title = `Scale of the rings: ${names[0]}. Click for ${names[1]}`
  }
  setLog(isLog)
  watchColours(NAMES, (now) => (colours = now))

  /** The range of the plot [m]: grows immediately, shrinks after a delay. */
  const adapt = (scan: LidarScan): number => {
    let farthest = scan.range_min
    for (const range of scan.ranges) if (Number.isFinite(range) && range > farthest) farthest = range
    const wanted = roundReach(Math.max(farthest, 0.4))
    if (wanted >= reach) shrinkTime = performance.now() + SHRINK_DELAY
    if (wanted > reach || performance.now() > shrinkTime) reach = wanted
    return reach
  }

  return {
    element: h('div', { class: 'polar', testid: 'hud-polar' }, canvas),
    toggle,
    nearest,
    refresh({ scan, scene, bearing }) {
      const paper = contextOf(canvas)
      setText(nearest, scan ? nearestText(scan, scene?.lidar ?? null) : '–')
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
      if (scan) drawScan(context, scan, yawOf(scene?.lidar), scale, radius, bearing, colours)
      drawNumbers(context, rings, scale, radius, colours)
      drawVehicle(context, colours)
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
  for (const [x, y] of [
    [1, 0],
    [0, 1],
  ] as const) {
    context.moveTo(-x * radius, -y * radius)
    context.lineTo(x * radius, y * radius)
  }
  context.stroke()
}

/** Draws the labels of the rings over the scan. */
function drawNumbers(context: Context, rings: number[], scale: Scale, radius: number, colours: Colours) {
  context.font = '13px system-ui, sans-serif'
  context.textAlign = 'center'
  context.textBaseline = 'middle'
  for (const ring of rings) {
    const at = scale(ring) * radius * Math.SQRT1_2
    if (at < 14) continue // overlaps the arrow
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
  bearing: number,
  colours: Colours,
) {
  const pointOf = (ray: number): [number, number] => {
    const angle = scan.angle_min + ray * scan.angle_increment + yaw
    const distance = Math.min(scale(scan.ranges[ray]), 1) * radius
    return [-Math.sin(angle) * distance, -Math.cos(angle) * distance]
  }
  const isSeen = (ray: number) => Number.isFinite(scan.ranges[ray])
  const count = scan.ranges.length

  // The free space from the sensor to each return; sectors without a return stay empty.
  context.fillStyle = colours['scan-fill']
  context.beginPath()
  for (let ray = 0; ray < count; ray++) {
    if (!isSeen(ray)) continue
    const half = scan.angle_increment / 2
    const angle = -Math.PI / 2 - (scan.angle_min + ray * scan.angle_increment + yaw)
    context.moveTo(0, 0)
    context.arc(0, 0, Math.min(scale(scan.ranges[ray]), 1) * radius, angle - half, angle + half)
  }
  context.fill()

  context.fillStyle = colours.scan
  for (let ray = 0; ray < count; ray++) {
    if (!isSeen(ray)) continue
    const [x, y] = pointOf(ray)
    context.fillRect(x - 1, y - 1, 2, 2)
  }

  // the measurement: a line to its return, or to the edge without one
  const ray = rayAt(scan, bearing - yaw)
  const isReturned = ray >= 0 && isSeen(ray)
  const [x, y] = isReturned ? pointOf(ray) : [-Math.sin(bearing) * radius, -Math.cos(bearing) * radius]
  context.strokeStyle = context.fillStyle = colours['plot-2']
  context.lineWidth = 1.5
  context.setLineDash(isReturned ? [] : [3, 4])
  context.beginPath()
  context.moveTo(0, 0)
  context.lineTo(x, y)
  context.stroke()
  context.setLineDash([])
  if (!isReturned) return
  context.beginPath()
  context.arc(x, y, 3, 0, 2 * Math.PI)
  context.fill()
}

/** Draws an arrow at the sensor. It does not show the size of the vehicle, which a logarithmic scale would distort. */
function drawVehicle(context: Context, colours: Colours) {
  context.fillStyle = colours.text
  context.beginPath()
  context.moveTo(0, -7)
  context.lineTo(5, 6)
  context.lineTo(0, 3.2)
  context.lineTo(-5, 6)
  context.fill()
}

/** Ranges of the plot with their number of rings; also used times powers of ten. */
const REACHES: readonly [reach: number, rings: number][] = [
  [1, 4],
  [1.2, 4],
  [1.6, 4],
  [2, 4],
  [3, 3],
  [4, 4],
  [5, 5],
  [6, 3],
  [8, 4],
  [10, 4],
]

/** The smallest range of the plot that includes a distance [m]. */
function roundReach(farthest: number): number {
  const power = 10 ** Math.floor(Math.log10(farthest))
  return (REACHES.find(([reach]) => reach * power >= farthest) ?? REACHES[0])[0] * power
}

function evenly(far: number): number[] {
  const mantissa = far / 10 ** Math.floor(Math.log10(far) + 1e-9)
  const rings = REACHES.find(([reach]) => Math.abs(reach - mantissa) < 1e-6)?.[1] ?? 4
  return Array.from({ length: rings }, (_, i) => ((i + 1) * far) / rings)
}

/** Rings at 1, 2, 5 times powers of ten between two distances [m]. */
function decades(least: number, far: number): number[] {
  const rings: number[] = []
  for (let ring = niceStep(least * 1.3); ring < far * 0.7; ring = niceStep(ring * 1.5)) rings.push(ring)
  return [...rings, far]
}

/** Distance and direction of the nearest return: "0.42 m\n35° left". */
function nearestText(scan: LidarScan, lidar: Pose | null): string {
  const ray = nearestRay(scan)
  if (ray < 0) return 'inf m'
  const turn = scan.angle_min + ray * scan.angle_increment + yawOf(lidar)
  const degrees = Math.round((Math.atan2(Math.sin(turn), Math.cos(turn)) * 180) / Math.PI)
  const side = degrees === 0 || Math.abs(degrees) === 180 ? '' : degrees > 0 ? ' left' : ' right'
  return `${fixed(scan.ranges[ray])} m\n${Math.abs(degrees)}°${side}`
}
