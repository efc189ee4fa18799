// Every scalar that can be plotted over time: its name, unit, and its value at a state.
import type { Plot } from '../channels'
import { PLOTS } from '../channels'
import type { VehicleFrame } from '../messages'
import type { HudState } from './hud_rows'
import { element, nearestRay, rangeAt, reader } from './hud_rows'

export interface Scalar {
  group: string
  label: string
  unit: string
  /** Least span of the axis, so that noise does not fill it. */
  span: number
  of: (state: HudState) => number
}

/** By the names that the page remembers. */
export const SIGNALS = new Map<string, Scalar>()

/** How a plot makes one number of a signal. */
function scalarOf(plot: Plot): Scalar['of'] {
  const read = reader(plot.signal)
  switch (plot.reduction) {
    case 'element':
      return (state) => element(read(state), plot.element) * plot.scale
    case 'nearest':
      return ({ scan }) => scan?.ranges[nearestRay(scan)] ?? NaN
    case 'beam':
      return rangeAt
  }
}

for (const [id, plot] of Object.entries(PLOTS)) SIGNALS.set(id, { ...plot, of: scalarOf(plot) })

const SIMULATION: [id: string, label: string, unit: string, span: number, of: Scalar['of']][] = [
  ['rtf', 'Real time', '×', 0.1, ({ status }) => status?.real_time_factor ?? NaN],
  ['frame-rate', 'Frame rate', 'Hz', 10, ({ frameRate }) => frameRate],
  ['telemetry', 'Telemetry', 'Hz', 10, ({ status }) => status?.bridge.telemetry_rate ?? NaN],
  ['commands', 'Commands', 'Hz', 10, ({ status }) => status?.bridge.command_rate ?? NaN],
  ['round-trip', 'Round trip', 'ms', 1, ({ status }) => (status?.bridge.round_trip ?? NaN) * 1000],
]
for (const [id, label, unit, span, of] of SIMULATION) {
  SIGNALS.set(id, { group: 'Simulation and bridge', label, unit, span, of })
}

/** Adds the values of the sensors of the user on a vehicle, which are known from their first reading on. */
export function addOwnSensors({ own }: VehicleFrame): void {
  for (const [name, { columns }] of Object.entries(own)) {
    for (const [i, column] of columns.entries()) {
      const id = `own-${name}-${column}`
      if (SIGNALS.has(id)) continue
      const [label, unit = ''] = column.split(' [')
      const of: Scalar['of'] = ({ vehicle }) => vehicle?.own[name]?.values[i] ?? NaN
      SIGNALS.set(id, { group: `Sensor ${name}`, label, unit: unit.replace(']', ''), span: 0.1, of })
    }
  }
}
