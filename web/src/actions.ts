// What a person can ask for, by button or by key. What cannot be done is told in a line.
import type { Connection } from './connection'
import type { Ask } from './messages'
import type { Camera, Store } from './store'

export const CAMERAS: readonly Camera[] = ["Driver's Eye", "Bird's Eye", "God's Eye", 'Orbit']

export class Actions {
  constructor(
    private readonly store: Store,
    private readonly connection: Connection,
  ) {}

  /** Asks the simulator; whether it was done. */
  async ask(request: Ask): Promise<boolean> {
    try {
      await this.connection.request(request)
      return true
    } catch (fault) {
      this.store.notice.value = sentence(fault)
      return false
    }
  }

  async reset(): Promise<void> {
    if (await this.ask({ type: 'Reset' })) {
      this.store.resets.value += 1
      this.store.notice.value = 'Reset to the initial state.'
    }
  }

  nextCamera(): void {
    this.store.camera.value = following(CAMERAS, this.store.camera.value)
  }

  nextVehicle(): void {
    const vehicles = Object.keys(this.store.scene.value?.vehicles ?? {})
    if (vehicles.length > 0) this.store.vehicle.value = following(vehicles, this.store.vehicle.value)
  }

  toggleSceneLight(): void {
    const frame = this.store.frame.value
    if (frame) void this.ask({ type: 'SetSceneLight', enabled: !frame.scene_light })
  }

  toggleMode(): void {
    const vehicle = this.store.vehicle.value
    const frame = this.store.frame.value?.vehicles[vehicle]
    if (frame) void this.ask({ type: 'SetDrivingMode', vehicle, is_autonomous: !frame.is_autonomous })
  }

  togglePause(): void {
    const status = this.store.status.value
    if (status) void this.ask({ type: status.is_paused ? 'Resume' : 'Pause' })
  }

  /** Runs that many ticks and stands still after them. */
  async step(ticks: number): Promise<void> {
    const isPaused = this.store.status.value?.is_paused || (await this.ask({ type: 'Pause' }))
    if (isPaused) await this.ask({ type: 'Step', ticks })
  }
}

/** The words of a fault, as a sentence. */
export function sentence(fault: unknown): string {
  const text = fault instanceof Error ? fault.message : String(fault)
  return text.charAt(0).toUpperCase() + text.slice(1) + (/[.!?)]$/.test(text) ? '' : '.')
}

function following<T>(all: readonly T[], one: T): T {
  return all[(all.indexOf(one) + 1) % all.length]!
}
