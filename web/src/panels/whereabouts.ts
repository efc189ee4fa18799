// What became of each vehicle by the events: whether it is off the road, and what it touched last.
import type { BackOnRoad, Collision, Event, OffRoad } from '../messages'

export class Whereabouts {
  private readonly road = new Map<string, OffRoad | BackOnRoad>()
  private readonly collisions = new Map<string, Collision>()

  add(events: readonly Event[]): void {
    for (const event of events) {
      if (event.type === 'Collision') this.collisions.set(event.vehicle, event)
      else this.road.set(event.vehicle, event)
    }
  }

  /** Forgets what lies after that time [s]: the world was reset. */
  forgetAfter(time: number): void {
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
