// Two signals over the whole recording, with the least and the greatest value of each column of pixels.
import uPlot from 'uplot'
import 'uplot/dist/uPlot.min.css'

import { PLOTS } from '../channels'
import type { Curve } from '../messages'
import { watchColours } from '../panels/colours'
import { h } from '../panels/element'
import { choice } from '../panels/fields'
import { loadPreference, savePreference } from '../panels/preferences'
import { niceTicks, tickText } from '../panels/scales'
import type { Range } from './window'

/** Width of the axis at each side [px]; the marks have the same margins. */
export const AXIS = 48
const HEIGHT = 120
const NOTHING = 'none'
const COLOURS = ['plot-1', 'plot-2'] as const
const FIRST = ['speed', 'steering'] as const

interface Trace {
  select: HTMLSelectElement
  ticks: number[]
}

type Columns = (number | null)[]

export interface RunPlot {
  element: HTMLElement
  /** The plots that are selected, without repetition. */
  readonly wanted: string[]
  /** Draws curves over a range of times. */
  show: (curves: Record<string, Curve>, range: Range) => void
}

/** `onChoice` is called when the user selects another signal. */
export function runPlot(onChoice: () => void): RunPlot {
  const traces = FIRST.map((id, i) => trace(id, i, onChoice))
  const canvas = h('div', { class: 'run-plot-canvas', role: 'img', 'aria-label': 'Signals over the recording' })
  const element = h(
    'div',
    { class: 'run-plot', testid: 'run-plot' },
    h('div', { class: 'run-plot-legend' }, ...traces.map((one) => one.select.parentElement)),
    canvas,
  )
  const colours = { 'plot-1': '', 'plot-2': '', grid: '', muted: '' }
  let shown: Range = { start: 0, end: 1 }
  let chart: uPlot | null = null
  let latest: [Record<string, Curve>, Range] | null = null
  watchColours(['plot-1', 'plot-2', 'grid', 'muted'], (now) => {
    Object.assign(colours, now)
    chart?.redraw(false)
  })
  new ResizeObserver(() => latest && draw(...latest)).observe(canvas)

  function draw(curves: Record<string, Curve>, range: Range): void {
    const width = canvas.clientWidth
    if (width === 0) return
    chart ??= new uPlot(
      options(width, traces, colours, () => shown),
      [[], [], [], [], []],
      canvas,
    )
    if (chart.width !== width) chart.setSize({ width, height: HEIGHT })
    shown = range
    const both = traces.map(({ select }) => scaled(curves[select.value], select.value))
    const n = Math.max(...both.map(({ low }) => low.length))
    const times = Array.from({ length: n }, (_, i) => range.start + ((i + 0.5) / n) * (range.end - range.start))
    traces.forEach((one, i) => {
      const span = plotOf(one.select.value)?.span ?? 1
      one.ticks = niceTicks([...both[i].low, ...both[i].high], span)
    })
    const [a, b] = both
    chart.setData([times, a.high, a.low, b.high, b.low] as uPlot.AlignedData)
  }

  return {
    element,
    get wanted() {
      return [...new Set(traces.map(({ select }) => select.value))].filter((id) => id !== NOTHING)
    },
    show(curves, range) {
      latest = [curves, range]
      draw(curves, range)
    },
  }
}

function plotOf(id: string): { label: string; unit: string; span: number; scale: number } | undefined {
  return id in PLOTS ? PLOTS[id as keyof typeof PLOTS] : undefined
}

/** Values in the unit of the plot; NaN and infinite values become gaps. */
function scaled(curve: Curve | undefined, id: string): { low: Columns; high: Columns } {
  const scale = plotOf(id)?.scale ?? 1
  const values = (of: Float64Array | undefined): Columns =>
    Array.from(of ?? [], (value) => (Number.isFinite(value) ? value * scale : null))
  return { low: values(curve?.low), high: values(curve?.high) }
}

function trace(first: string, i: number, onChoice: () => void): Trace {
  const key = `run-plot.${i}`
  const choose = (id: string) => {
    savePreference(key, id)
    onChoice()
  }
  const label = { 'aria-label': `Signal ${i + 1} over the recording`, title: 'Plotted signal' }
  const select = choice(`run-signal-${i}`, choose, label)
  const groups = new Map<string, HTMLOptGroupElement>()
  select.append(h('option', { value: NOTHING }, 'None'))
  for (const [id, { group, label, unit, reduction }] of Object.entries(PLOTS)) {
    if (reduction === 'beam') continue // its direction is a choice of each viewer
    const list = groups.get(group) ?? h('optgroup', { label: group })
    if (!groups.has(group)) select.append(list)
    groups.set(group, list)
    list.append(h('option', { value: id }, unit ? `${label} [${unit}]` : label))
  }
  const kept = loadPreference(key)
  select.value = kept !== null && (kept === NOTHING || kept in PLOTS) ? kept : first
  h('label', { class: 'plot-trace', style: `--trace: var(--${COLOURS[i]})` }, select)
  return { select, ticks: [0, 1] }
}

function options(
  width: number,
  traces: Trace[],
  colours: Record<(typeof COLOURS)[number] | 'grid' | 'muted', string>,
  range: () => Range,
): uPlot.Options {
  const font = '13px system-ui, sans-serif'
  const scale = (i: number) => (): uPlot.Range.MinMax => [
    traces[i].ticks[0],
    traces[i].ticks[traces[i].ticks.length - 1],
  ]
  const axis = (i: number): uPlot.Axis => ({
    scale: `y${i}`,
    side: i === 0 ? 3 : 1,
    size: AXIS,
    gap: 4,
    font,
    stroke: () => colours[COLOURS[i]],
    grid: i === 0 ? { stroke: () => colours.grid, width: 1 } : { show: false },
    ticks: { show: false },
    splits: () => (traces[i].select.value === NOTHING ? [] : traces[i].ticks),
    values: (_, splits) => splits.map((value) => tickText(value, (splits[1] ?? 1) - (splits[0] ?? 0))),
  })
  const line = (i: number): uPlot.Series => ({
    scale: `y${i}`,
    stroke: () => colours[COLOURS[i]],
    width: 1,
    points: { show: false },
  })
  return {
    width,
    height: HEIGHT,
    padding: [8, 0, 8, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: () => [range().start, range().end] },
      y0: { range: scale(0) },
      y1: { range: scale(1) },
    },
    series: [{}, line(0), line(0), line(1), line(1)],
    bands: [
      { series: [1, 2], fill: () => faded(colours['plot-1']) },
      { series: [3, 4], fill: () => faded(colours['plot-2']) },
    ],
    axes: [{ show: false }, axis(0), axis(1)],
  }
}

function faded(colour: string): string {
  return colour.replace('rgb(', 'rgba(').replace(')', ', 0.45)')
}
