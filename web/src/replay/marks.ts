// The marks of events on the timeline.
import { describe } from '../log'
import type { Mark, Scene } from '../messages'
import { contextOf } from '../panels/canvas'
import { watchColours } from '../panels/colours'
import { h } from '../panels/element'
import { clock } from '../panels/hud_rows'
import { niceStep, tickText } from '../panels/scales'
import type { TimeWindow } from './window'

const COLOURS = ['bad', 'warn', 'good', 'accent', 'muted', 'line'] as const
type Colour = (typeof COLOURS)[number]
const COLOUR_OF: Partial<Record<Mark['event']['type'], Colour>> = {
  Collision: 'bad',
  OffRoad: 'warn',
  BackOnRoad: 'good',
  RedLight: 'bad',
  StopSign: 'bad',
}
/** Distance between two times that are written [px]. */
const SPACING = 90
/** A mark within this distance of the pointer is named [px]. */
const NEAR = 5

/** The canvas with times and marks, and a function that draws it. */
export function marksCanvas(window_: TimeWindow): {
  element: HTMLCanvasElement
  draw: (marks: readonly Mark[]) => void
} {
  const element = h('canvas', { class: 'timeline-marks', 'aria-hidden': 'true' })
  const colours: Record<string, string> = {}
  let shown: readonly Mark[] = []
  watchColours(COLOURS, (now) => {
    Object.assign(colours, now)
    draw(shown)
  })

  function draw(marks: readonly Mark[]): void {
    shown = marks
    const area = contextOf(element)
    if (!area) return
    const { context, width, height } = area
    const { start, end } = window_.range.value
    context.font = '13px system-ui, sans-serif'
    context.textBaseline = 'bottom'
    const step = timeStep(((end - start) * SPACING) / width)
    let written = 0 // right end of the last time
    for (let i = Math.ceil(start / step); i * step <= end; i++) {
      const x = Math.round(window_.shareOf(i * step) * width)
      context.fillStyle = colours.line
      context.fillRect(x, 0, 1, height)
      context.fillStyle = colours.muted
      const text = timeText(i * step, step)
      const length = context.measureText(text).width
      const left = x + 4 + length > width ? x - 4 - length : x + 4
      if (left < written) continue
      context.fillText(text, left, height)
      written = left + length + 4
    }
    const drawn = new Set<number>()
    for (const { time, event } of marks) {
      if (time < start || time > end) continue
      const x = Math.round(window_.shareOf(time) * width)
      const colour = COLOUR_OF[event.type] ?? 'accent'
      const key = 8 * x + COLOURS.indexOf(colour)
      if (drawn.has(key)) continue
      drawn.add(key)
      context.fillStyle = colours[colour]
      context.fillRect(x - 1, 0, 3, 12)
    }
  }

  return { element, draw }
}

/** The text about a place of the timeline: its time, and the event that is near. */
export function textAt(scene: Scene | null, window_: TimeWindow, share: number, width: number): string {
  const time = window_.timeAt(share)
  let nearest: Mark | null = null
  for (const mark of scene?.timeline?.marks ?? []) {
    const distance = Math.abs(window_.shareOf(mark.time) - share) * width
    if (distance <= NEAR && (!nearest || distance < Math.abs(window_.shareOf(nearest.time) - share) * width))
      nearest = mark
  }
  return nearest ? `${preciseClock(nearest.time)} ${describe(nearest.event, scene)[0]}` : preciseClock(time)
}

/** H:MM:SS with hundredths. */
export function preciseClock(time: number): string {
  const hundredths = Math.floor(time * 100 + 1e-6)
  return `${clock(hundredths / 100)}.${String(hundredths % 100).padStart(2, '0')}`
}

/** A round number of seconds, minutes or hours that is at least `least` [s]. */
function timeStep(least: number): number {
  if (least < 1) return niceStep(least)
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600]
  return steps.find((step) => step >= least) ?? 3600 * Math.ceil(least / 3600)
}

function timeText(time: number, step: number): string {
  return step < 1 ? `${tickText(time, step)} s` : clock(time)
}
