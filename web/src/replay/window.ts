// The part of a recording that the timeline shows: all of it, or a part that the wheel has enlarged.
import { Observable } from '../observable'

/** The shortest part [s]. */
const SHORTEST = 2
/** Change of the length by one click of the wheel. */
const ZOOM = 1.25

export interface Range {
  start: number
  end: number
}

export class TimeWindow {
  readonly range = new Observable<Range>({ start: 0, end: 1 })
  private duration = 1

  /** Shows the whole recording. */
  showAll(duration: number): void {
    this.duration = Math.max(duration, 1e-3)
    this.range.value = { start: 0, end: this.duration }
  }

  get isWhole(): boolean {
    const { start, end } = this.range.value
    return end - start >= this.duration
  }

  /** Enlarges by a number of clicks around the time at a share of the width. */
  zoom(clicks: number, share: number): void {
    const { start, end } = this.range.value
    const shortest = Math.min(SHORTEST, this.duration)
    const length = Math.min(Math.max((end - start) * ZOOM ** -clicks, shortest), this.duration)
    this.moveTo(this.timeAt(share) - share * length, length)
  }

  /** Moves the window, if it does not contain that time. */
  follow(time: number): void {
    const { start, end } = this.range.value
    const length = end - start
    if (time < start || time > end) this.moveTo(time - 0.1 * length, length)
  }

  /** The time at a share of the width [s]. */
  timeAt(share: number): number {
    const { start, end } = this.range.value
    return start + share * (end - start)
  }

  /** The share of the width of a time. */
  shareOf(time: number): number {
    const { start, end } = this.range.value
    return (time - start) / (end - start)
  }

  private moveTo(first: number, length: number): void {
    const start = Math.min(Math.max(first, 0), this.duration - length)
    this.range.value = { start, end: start + length }
  }
}
