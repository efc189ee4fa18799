// What the plots of two signals share: for each signal a selection, a colour, a line and an axis.
import type uPlot from 'uplot'
import 'uplot/dist/uPlot.min.css'

import { watchColours } from './colours'
import { h } from './element'
import { tickText } from './scales'

/** The value of a selection without a signal. */
export const NOTHING = 'none'
export const COLOURS = ['plot-1', 'plot-2'] as const
export const FONT = '13px system-ui, sans-serif'

/** One of the two signals: its selection, and the ticks of its axis. */
export interface Trace {
  select: HTMLSelectElement
  ticks: number[]
}

export type PlotColours = Record<(typeof COLOURS)[number] | 'grid' | 'muted', string>

/** The colours of the theme; when they change, the chart is drawn again. */
export function plotColours(chart: () => uPlot | null): PlotColours {
  const colours = { 'plot-1': '', 'plot-2': '', grid: '', muted: '' }
  watchColours(['plot-1', 'plot-2', 'grid', 'muted'], (now) => {
    Object.assign(colours, now)
    chart()?.redraw(false)
  })
  return colours
}

/** Returns a function that adds an option to its group of a selection; the group is made with its first option. */
export function groupedOptions(select: HTMLSelectElement): (group: string, value: string, text: string) => void {
  const groups = new Map<string, HTMLOptGroupElement>()
  select.append(h('option', { value: NOTHING }, 'None'))
  return (group, value, text) => {
    const list = groups.get(group) ?? h('optgroup', { label: group })
    if (!groups.has(group)) select.append(list)
    groups.set(group, list)
    list.append(h('option', { value }, text))
  }
}

/** The label around the selection of signal `i`, with its colour. */
export function traceLabel(i: number, ...children: Node[]): HTMLLabelElement {
  return h('label', { class: 'plot-trace', style: `--trace: var(--${COLOURS[i]})` }, ...children)
}

interface Layout {
  width: number
  height: number
  padding: uPlot.Padding
  /** Width of the axis at each side [px]. */
  axis: number
  lineWidth: number
  /** The signal, 0 or 1, of each series of the data. */
  series: number[]
  /** Least and greatest value of x. */
  range: () => [number, number]
  /** The axis of x; without it, none is drawn. */
  x?: uPlot.Axis
}

export function twoAxes(traces: Trace[], colours: PlotColours, layout: Layout): uPlot.Options {
  const ends = (i: number) => (): uPlot.Range.MinMax => [traces[i].ticks[0], traces[i].ticks.at(-1) ?? 1]
  const axis = (i: number): uPlot.Axis => ({
    scale: `y${i}`,
    side: i === 0 ? 3 : 1,
    size: layout.axis,
    gap: 4,
    font: FONT,
    stroke: () => colours[COLOURS[i]],
    grid: i === 0 ? { stroke: () => colours.grid, width: 1 } : { show: false },
    ticks: { show: false },
    splits: () => (traces[i].select.value === NOTHING ? [] : traces[i].ticks),
    values: (_, splits) => splits.map((value) => tickText(value, (splits[1] ?? 1) - (splits[0] ?? 0))),
  })
  const line = (i: number): uPlot.Series => ({
    scale: `y${i}`,
    stroke: () => colours[COLOURS[i]],
    width: layout.lineWidth,
    points: { show: false },
  })
  return {
    width: layout.width,
    height: layout.height,
    padding: layout.padding,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, range: layout.range }, y0: { range: ends(0) }, y1: { range: ends(1) } },
    series: [{}, ...layout.series.map(line)],
    axes: [layout.x ?? { show: false }, axis(0), axis(1)],
  }
}
