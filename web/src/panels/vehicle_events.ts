// The latest events of each vehicle: whether it is off the road, and its last collision.
import type { BackOnRoad, Collision, Event, OffRoad } from '../messages'

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
