// A plot of two selectable scalars over the last seconds of simulated time.
import uPlot from 'uplot'

import { h, setText } from './element'
import { choice } from './fields'
import type { History } from './history'
import { fixed } from './hud_rows'
import { loadPreference, savePreference } from './preferences'
import { niceTicks } from './scales'
import { SIGNALS } from './signals'
import {
  FONT,
  groupedOptions,
  NOTHING,
  type PlotColours,
  plotColours,
  type Trace,
  traceLabel,
  twoAxes,
} from './two_axes'

export interface Plot {
  element: HTMLElement
  /** Draws the last `seconds` of the history. */
  refresh: (history: History, seconds: number) => void
}

const HEIGHT = 92
const AXIS = 40

/** One of the two scalars, with its drawn values, and the element with its latest value. */
interface Scalar extends Trace {
  /** Offers the signals that are known now. */
  offer: () => void
  now: HTMLElement
  values: (number | null)[]
}

/** `key` is the name under which the selection is saved; `first` are the defaults. */
export function plot(key: string, first: readonly [string, string]): Plot {
  const traces = first.map((id, i) => trace(`${key}.${i}`, id, i))
  const canvas = h('div', { class: 'plot-canvas', role: 'img', 'aria-label': 'Signals over time' })
  const element = h(
    'div',
    { class: 'plot', testid: 'hud-plot' },
    h('div', { class: 'plot-legend' }, ...traces.map((trace) => trace.select.parentElement)),
    canvas,
  )
  const ages: number[] = []
  let chart: uPlot | null = null
  const colours = plotColours(() => chart)
  let seconds = 0

  return {
    element,
    refresh(history, window) {
      const width = canvas.clientWidth
      if (width === 0) return
      chart ??= new uPlot(
        options(width, traces, colours, () => seconds),
        [[], [], []],
        canvas,
      )
      for (const { offer } of traces) offer()
      if (chart.width !== width) chart.setSize({ width, height: HEIGHT })
      seconds = window
      take(history, window, ages, traces)
      chart.setData([ages, traces[0].values, traces[1].values] as uPlot.AlignedData)
    },
  }
}

/** Copies the last seconds from the history; values that are not finite become gaps. */
function take(history: History, window: number, ages: number[], traces: Scalar[]): void {
  const end = history.length
  const now = history.times[end - 1] ?? 0
  const start = end === 0 ? 0 : history.since(now - window)
  ages.length = end - start
  for (let row = start; row < end; row++) ages[row - start] = history.times[row] - now
  for (const { select, values, now: text } of traces) {
    const column = history.columns.get(select.value)
    values.length = end - start
    for (let row = start; row < end; row++) {
      const value = column?.[row] ?? NaN
      values[row - start] = Number.isFinite(value) ? value : null
    }
    setText(text, column && end > 0 ? `${fixed(column[end - 1])} ${SIGNALS.get(select.value)?.unit ?? ''}` : '')
  }
  traces.forEach((trace, i) => {
    const scalar = SIGNALS.get(trace.select.value)
    const other = traces[1 - i]
    const isShared = scalar && scalar.unit === SIGNALS.get(other.select.value)?.unit
    trace.ticks = niceTicks(isShared ? [...trace.values, ...other.values] : trace.values, scalar?.span ?? 1)
  })
}

function trace(key: string, first: string, i: number): Scalar {
  const label = { 'aria-label': `Signal ${i + 1}`, title: 'Plotted signal' }
  const select = choice('hud-signal', (id) => savePreference(key, id), label)
  const add = groupedOptions(select)
  const kept = loadPreference(key)
  let offered = 0
  const offer = () => {
    if (offered === SIGNALS.size) return
    const isFirst = offered === 0
    for (const [id, { group, label }] of [...SIGNALS].slice(offered)) {
      add(group, id, label)
      if (id === kept && !isFirst) select.value = id // a sensor of the user
    }
    offered = SIGNALS.size
  }
  offer()
  select.value = kept !== null && (kept === NOTHING || SIGNALS.has(kept)) ? kept : first
  const now = h('output', { class: 'plot-now' })
  traceLabel(i, select, now)
  return { select, offer, now, ticks: [0, 1], values: [] }
}

function options(width: number, traces: Scalar[], colours: PlotColours, seconds: () => number): uPlot.Options {
  return twoAxes(traces, colours, {
    width,
    height: HEIGHT,
    padding: [6, 0, 0, 0],
    axis: AXIS,
    lineWidth: 1.5,
    series: [0, 1],
    range: () => [-seconds(), 0],
    x: {
      size: 20,
      gap: 2,
      font: FONT,
      stroke: () => colours.muted,
      grid: { stroke: () => colours.grid, width: 1 },
      ticks: { show: false },
      splits: () => [-0.75, -0.5, -0.25].map((share) => share * seconds()),
      values: (_, splits) => splits.map((value) => `${fixed(value, value % 1 ? 1 : 0)} s`),
    },
  })
}
