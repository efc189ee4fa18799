// Lamp requests of the user, repeated for some ticks: only the last command before a tick is used, so one could be lost.

import type { Command, Lights } from '../messages'
import { Headlights, Indicators } from '../messages'

/** How long a request is repeated [ms]: several ticks, even at a quarter of the speed. */
const REPEAT = 250

export class LampCommands {
  private command: Pick<Command, 'headlights' | 'indicators'> = {}
  private end = 0

  /** Switches `beam` on, or off if it is on. `lights` is the current state of the vehicle. */
  toggleHeadlights(beam: Headlights, lights: Lights): void {
    const now = this.pending().headlights ?? lights.headlights
    this.request({ headlights: now === beam ? Headlights.OFF : beam })
  }

  toggleIndicators(side: Indicators, lights: Lights): void {
    const now = this.pending().indicators ?? lights.indicators
    this.request({ indicators: now === side ? Indicators.OFF : side })
  }

  /** The request that is still repeated; empty if there is none. */
  pending(): Pick<Command, 'headlights' | 'indicators'> {
    if (performance.now() > this.end) this.command = {}
    return this.command
  }

  get isPending(): boolean {
    return Object.keys(this.pending()).length > 0
  }

  private request(change: Pick<Command, 'headlights' | 'indicators'>): void {
    this.command = { ...this.pending(), ...change }
    this.end = performance.now() + REPEAT
  }
}
