// The latest events of each vehicle: whether it is off the road, and its last collision.
import type { BackOnRoad, Collision, Event, Mark, OffRoad } from '../messages'

export class VehicleEvents {
  private readonly road = new Map<string, OffRoad | BackOnRoad>()
  private readonly collisions = new Map<string, Collision>()

  add(events: readonly Event[]): void {
    for (const event of events) {
      if (event.type === 'Collision') this.collisions.set(event.vehicle, event)
      else if (event.type === 'OffRoad' || event.type === 'BackOnRoad') this.road.set(event.vehicle, event)
    }
  }

  /** Removes the events after `time` [s], when the world was reset. */
  dropAfter(time: number): void {
    for (const events of [this.road, this.collisions])
      for (const [vehicle, event] of events) if (event.time > time + 1e-6) events.delete(vehicle)
  }

  /**
   * Takes the events of a recording up to `position` [s], since the last reset; `time` [s] is that of the Frame there.
   * A reset changes the difference of the two; `tolerance` [s] is how much it differs otherwise.
   */
  showRecorded(marks: readonly Mark[], position: number, time: number, tolerance: number): void {
    this.clear()
    const isSameRun = (mark: Mark) => Math.abs(mark.time - mark.event.time - (position - time)) < tolerance
    this.add(marks.filter((mark) => mark.time <= position + 1e-6 && isSameRun(mark)).map(({ event }) => event))
  }

  isOffRoad(vehicle: string): boolean {
    return this.road.get(vehicle)?.type === 'OffRoad'
  }

  lastCollision(vehicle: string): Collision | null {
    return this.collisions.get(vehicle) ?? null
  }

  clear(): void {
    this.road.clear()
    this.collisions.clear()
  }
}
