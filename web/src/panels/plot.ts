// A plot of two selectable scalars over the last seconds of simulated time.
import uPlot from 'uplot'
import 'uplot/dist/uPlot.min.css'

import { watchColours } from './colours'
import { h, setText } from './element'
import { choice } from './fields'
import type { History } from './history'
import { fixed } from './hud_rows'
import { loadPreference, savePreference } from './preferences'
import { niceTicks, tickText } from './scales'
import { SIGNALS } from './signals'

export interface Plot {
  element: HTMLElement
  /** Draws the last `seconds` of the history. */
  refresh: (history: History, seconds: number) => void
}

const NOTHING = 'none'
const COLOURS = ['plot-1', 'plot-2'] as const
const HEIGHT = 92
const AXIS = 40

/** One of the two scalars: its selection, its drawn values, and the element with its latest value. */
interface Trace {
  select: HTMLSelectElement
  /** Offers the signals that are known now. */
  offer: () => void
  now: HTMLElement
  ticks: number[]
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
  const colours = { 'plot-1': '', 'plot-2': '', grid: '', muted: '' }
  const ages: number[] = []
  let chart: uPlot | null = null
  let seconds = 0
  watchColours(['plot-1', 'plot-2', 'grid', 'muted'], (now) => {
    Object.assign(colours, now)
    chart?.redraw(false)
  })

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
      for (const one of traces) one.offer()
      if (chart.width !== width) chart.setSize({ width, height: HEIGHT })
      seconds = window
      take(history, window, ages, traces)
      chart.setData([ages, traces[0].values, traces[1].values] as uPlot.AlignedData)
    },
  }
}

/** Copies the last seconds from the history; values that are not finite become gaps. */
function take(history: History, window: number, ages: number[], traces: Trace[]): void {
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

function trace(key: string, first: string, i: number): Trace {
  const label = { 'aria-label': `Signal ${i + 1}`, title: 'Plotted signal' }
  const select = choice('hud-signal', (id) => savePreference(key, id), label)
  const groups = new Map<string, HTMLOptGroupElement>()
  const kept = loadPreference(key)
  let offered = 0
  const offer = () => {
    if (offered === SIGNALS.size) return
    const isFirst = offered === 0
    for (const [id, { group, label }] of [...SIGNALS].slice(offered)) {
      const list = groups.get(group) ?? h('optgroup', { label: group })
      if (!groups.has(group)) select.append(list)
      groups.set(group, list)
      list.append(h('option', { value: id }, label))
      if (id === kept && !isFirst) select.value = id // a sensor of the user
    }
    offered = SIGNALS.size
  }
  select.append(h('option', { value: NOTHING }, 'None'))
  offer()
  select.value = kept !== null && (kept === NOTHING || SIGNALS.has(kept)) ? kept : first
  const now = h('output', { class: 'plot-now' })
  h('label', { class: 'plot-trace', style: `--trace: var(--${COLOURS[i]})` }, select, now)
  return { select, offer, now, ticks: [0, 1], values: [] }
}

function options(
  width: number,
  traces: Trace[],
  colours: Record<(typeof COLOURS)[number] | 'grid' | 'muted', string>,
  seconds: () => number,
): uPlot.Options {
  const font = '13px system-ui, sans-serif'
  const range = (i: number) => (): uPlot.Range.MinMax => {
    const ticks = traces[i].ticks
    return [ticks[0], ticks[ticks.length - 1]]
  }
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
    width: 1.5,
    points: { show: false },
  })
  return {
    width,
    height: HEIGHT,
    padding: [6, 0, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: () => [-seconds(), 0] },
      y0: { range: range(0) },
      y1: { range: range(1) },
    },
    series: [{}, line(0), line(1)],
    axes: [
      {
        size: 20,
        gap: 2,
        font,
        stroke: () => colours.muted,
        grid: { stroke: () => colours.grid, width: 1 },
        ticks: { show: false },
        splits: () => [-0.75, -0.5, -0.25].map((share) => share * seconds()),
        values: (_, splits) => splits.map((value) => `${fixed(value, value % 1 ? 1 : 0)} s`),
      },
      axis(0),
      axis(1),
    ],
  }
}
