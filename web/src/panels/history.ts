// The last seconds of all signals, side by side in columns that grow, and drop their older half when full.
import { SIGNALS } from './signals'
import type { Moment } from './hud_rows'

/** Rows that are kept at least, and how close in simulated time two may be [s]: 30 s and a little. */
const KEPT = 2048
const SPACING = 0.015

export class History {
  /** Of each row [s]. */
  readonly times = new Float64Array(2 * KEPT)
  readonly columns: ReadonlyMap<string, Float64Array>
  /** Rows that are filled. */
  length = 0

  constructor() {
    this.columns = new Map([...SIGNALS.keys()].map((id) => [id, new Float64Array(2 * KEPT)]))
  }

  /** Adds the moment, unless the last one is about as old; what lies in the future of it is forgotten. */
  add(moment: Moment): void {
    const time = moment.frame?.time
    if (time === undefined || !moment.vehicle) return
    const last = this.times[this.length - 1] ?? -Infinity
    if (this.length > 0 && time < last) this.length = 0
    else if (this.length > 0 && time < last + SPACING) return
    if (this.length === this.times.length) this.halve()
    this.times[this.length] = time
    for (const [id, column] of this.columns) column[this.length] = SIGNALS.get(id)!.of(moment, moment.vehicle)
    this.length += 1
  }

  /** The first row that is not older than that. */
  since(time: number): number {
    let low = 0
    let high = this.length
    while (low < high) {
      const middle = (low + high) >> 1
      if (this.times[middle]! < time) low = middle + 1
      else high = middle
    }
    return low
  }

  clear(): void {
    this.length = 0
  }

  private halve(): void {
    for (const column of [this.times, ...this.columns.values()]) column.copyWithin(0, KEPT)
    this.length = KEPT
  }
}
