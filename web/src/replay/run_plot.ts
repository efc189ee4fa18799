// Two signals over the whole recording, with the least and the greatest value of each column of pixels.
import uPlot from 'uplot'

import { PLOTS } from '../channels'
import type { Curve } from '../messages'
import { h } from '../panels/element'
import { choice } from '../panels/fields'
import { loadPreference, savePreference } from '../panels/preferences'
import { niceTicks } from '../panels/scales'
import {
  groupedOptions,
  NOTHING,
  type PlotColours,
  plotColours,
  type Trace,
  traceLabel,
  twoAxes,
} from '../panels/two_axes'
import type { Range } from './window'

/** Width of the axis at each side [px]; the marks have the same margins. */
export const AXIS = 48
const HEIGHT = 120
const FIRST = ['speed', 'steering'] as const

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
    h('div', { class: 'run-plot-legend' }, ...traces.map(({ select }) => select.parentElement)),
    canvas,
  )
  let shown: Range = { start: 0, end: 1 }
  let chart: uPlot | null = null
  const colours = plotColours(() => chart)
  let latest: [Record<string, Curve>, Range] | null = null
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
  const add = groupedOptions(select)
  for (const [id, { group, label, unit, reduction }] of Object.entries(PLOTS)) {
    if (reduction === 'beam') continue // its direction is a choice of each viewer
    add(group, id, unit ? `${label} [${unit}]` : label)
  }
  const kept = loadPreference(key)
  select.value = kept !== null && (kept === NOTHING || kept in PLOTS) ? kept : first
  traceLabel(i, select)
  return { select, ticks: [0, 1] }
}

function options(width: number, traces: Trace[], colours: PlotColours, shown: () => Range): uPlot.Options {
  const axes = twoAxes(traces, colours, {
    width,
    height: HEIGHT,
    padding: [8, 0, 8, 0],
    axis: AXIS,
    lineWidth: 1,
    series: [0, 0, 1, 1],
    range: () => [shown().start, shown().end],
  })
  const bands: uPlot.Band[] = [
    { series: [1, 2], fill: () => faded(colours['plot-1']) },
    { series: [3, 4], fill: () => faded(colours['plot-2']) },
  ]
  return { ...axes, bands }
}

function faded(colour: string): string {
  return colour.replace('rgb(', 'rgba(').replace(')', ', 0.45)')
}
