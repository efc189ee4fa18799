// The events that people are told: a vehicle on the edge of a road leaves it and comes back many times.
import type { BackOnRoad, Event } from './messages'

/** A vehicle that has come back is told to be on the road when it has stayed there for this time [s]. */
const STAY = 1

export class CalmEvents {
  /** Vehicles that people know to be off the road, with the event of their return that is not told yet. */
  private readonly off = new Map<string, BackOnRoad | null>()
  private time = 0

  /** The events to tell at a simulated time [s], with those that have happened since the last call. */
  at(time: number, events: readonly Event[]): Event[] {
    if (time < this.time) this.off.clear()
    this.time = time
    const told = events.filter((event) => this.isNews(event))
    for (const [vehicle, back] of this.off)
      if (back && time - back.time >= STAY) {
        this.off.delete(vehicle)
        told.push(back)
      }
    return told
  }

  /** Forgets all vehicles, before another scenario. */
  clear(): void {
    this.off.clear()
    this.time = 0
  }

  private isNews(event: Event): boolean {
    if (event.type === 'OffRoad') {
      const isKnown = this.off.has(event.vehicle)
      this.off.set(event.vehicle, null)
      return !isKnown
    }
    if (event.type !== 'BackOnRoad') return true
    if (!this.off.has(event.vehicle)) return true
    this.off.set(event.vehicle, event)
    return false
  }
}
