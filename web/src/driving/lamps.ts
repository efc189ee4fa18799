// The lamps that a person asked for, said a while: the last command before a tick counts, so one alone may be missed.
import { Headlights, Indicators } from '../messages'
import type { Command, Lights } from '../messages'

/** How long a wish is repeated [ms]: some ticks, also at a quarter of the speed. */
const REPEAT = 250

export class Lamps {
  private wish: Pick<Command, 'headlights' | 'indicators'> = {}
  private end = 0

  /** On if they are off or other, off if they are on. `lights`: what the lamps do now. */
  toggleHeadlights(beam: Headlights, lights: Lights): void {
    const now = this.latest().headlights ?? lights.headlights
    this.ask({ headlights: now === beam ? Headlights.OFF : beam })
  }

  toggleIndicators(side: Indicators, lights: Lights): void {
    const now = this.latest().indicators ?? lights.indicators
    this.ask({ indicators: now === side ? Indicators.OFF : side })
  }

  /** What is still to be said; empty if nothing is. */
  latest(): Pick<Command, 'headlights' | 'indicators'> {
    if (performance.now() > this.end) this.wish = {}
    return this.wish
  }

  get isAsking(): boolean {
    return Object.keys(this.latest()).length > 0
  }

  private ask(wish: Pick<Command, 'headlights' | 'indicators'>): void {
    this.wish = { ...this.latest(), ...wish }
    this.end = performance.now() + REPEAT
  }
}
