// The recent history of all plotted scalars, in columns that drop their older half when they are full.

import type { HudState } from './hud_rows'
import { addOwnSensors, SIGNALS } from './signals'

/** Minimum number of rows that are kept, and minimum simulated time between rows [s]: 30 s in total. */
const KEPT = 2048
const SPACING = 0.015

export class History {
  /** Simulated time of each row [s]. */
  readonly times = new Float64Array(2 * KEPT)
  readonly columns = new Map<string, Float64Array>()
  /** Number of rows. */
  length = 0

  /** Adds a row, unless the last one is too recent. Clears the history if time went back. */
  add(state: HudState): void {
    const time = state.frame?.time
    if (time === undefined || !state.vehicle) return
    const last = this.times[this.length - 1] ?? -Infinity
    if (this.length > 0 && time < last) this.length = 0
    else if (this.length > 0 && time < last + SPACING) return
    if (this.length === this.times.length) this.halve()
    this.times[this.length] = time
    addOwnSensors(state.vehicle)
    for (const [id, { of }] of SIGNALS) this.column(id)[this.length] = of(state)
    this.length += 1
  }

  /** Index of the first row at or after `time` [s]. */
  since(time: number): number {
    let low = 0
    let high = this.length
    while (low < high) {
      const middle = (low + high) >> 1
      if (this.times[middle] < time) low = middle + 1
      else high = middle
    }
    return low
  }

  clear(): void {
    this.length = 0
  }

  private column(id: string): Float64Array {
    const column = this.columns.get(id) ?? new Float64Array(2 * KEPT).fill(NaN)
    this.columns.set(id, column)
    return column
  }

  private halve(): void {
    for (const column of [this.times, ...this.columns.values()]) column.copyWithin(0, KEPT)
    this.length = KEPT
  }
}
