// The time of a recording that is shown: follows the server between two messages, and the user while he drags.
import type { Connection } from '../connection'
import type { Timeline } from '../messages'
import type { Store } from '../store'

/** Two times that differ by less [s] are the same. */
const SAME = 1e-6

export class Playhead {
  /** Where the user has moved it, until the server shows that time. */
  private wanted: number | null = null
  private isSeeking = false
  private known = { position: 0, at: 0, rate: 0 }

  /** `fail` shows why a request was refused. `now`: wall time [ms]. */
  constructor(
    private readonly store: Store,
    private readonly connection: Connection,
    private readonly fail: (error: unknown) => void,
    private readonly now: () => number = () => performance.now(),
  ) {
    store.status.watch((status) => {
      if (!status || status.position === null) return
      const rate = status.is_paused ? 0 : (status.speed ?? 0)
      this.known = { position: status.position, at: this.now(), rate }
      if (!this.isSeeking) this.wanted = null
    })
  }

  get timeline(): Timeline | null {
    return this.store.scene.value?.timeline ?? null
  }

  /** Time of the recording that is shown [s]. */
  get position(): number {
    if (this.wanted !== null) return this.wanted
    const { position, at, rate } = this.known
    return this.clamp(position + ((this.now() - at) / 1000) * rate)
  }

  /** Moves to a time [s]. Of many calls only the latest is sent when the server has answered the one before. */
  seek(time: number): void {
    this.wanted = this.clamp(time)
    if (!this.isSeeking) void this.send()
  }

  /** Moves to the next event, or with -1 to the one before; returns it. */
  jump(direction: 1 | -1): Timeline['marks'][number] | undefined {
    const marks = this.timeline?.marks ?? []
    const here = this.position
    const mark =
      direction > 0
        ? marks.find(({ time }) => time > here + SAME)
        : [...marks].reverse().find(({ time }) => time < here - SAME)
    if (mark) this.seek(mark.time)
    return mark
  }

  private async send(): Promise<void> {
    this.isSeeking = true
    let sent: number | null = null
    try {
      while (this.wanted !== null && this.wanted !== sent) {
        sent = this.wanted
        await this.connection.request({ type: 'Seek', time: sent })
      }
      if (sent !== null) this.known = { ...this.known, position: sent, at: this.now() }
    } catch (error) {
      this.wanted = null
      this.fail(error)
    }
    this.isSeeking = false
  }

  private clamp(time: number): number {
    return Math.min(Math.max(time, 0), this.timeline?.duration ?? 0)
  }
}
