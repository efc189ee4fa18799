// Edits of the scenario: the selected vehicle or object, its preview while it is moved, and the requests.
import type { Actions } from '../actions'
import type { Frame, Pose, SetSensor } from '../messages'
import type { Placement, Store } from '../store'
import { extentOf, middleOf } from './outline'
import { saveText } from './save_text'

/** Length, width, height [m] and mass [kg] of a new box. */
export interface BoxShape {
  size: [number, number, number]
  mass: number
}

/** How long the preview outlives the Response [ms]: the view shows Frames with a short delay. */
const SETTLING = 200
/** A new box is placed on rings at this distance from each other, with this gap to others [m]. */
const GRID = 0.05
const GAP = 0.02
const RINGS = 40

export class Editor {
  /** The shape of the next box. */
  shape: BoxShape = { size: [0.1, 0.1, 0.1], mass: 0.1 }

  constructor(
    private readonly store: Store,
    private readonly actions: Actions,
  ) {
    store.frame.watch((frame) => this.checkSelection(frame))
    store.isEditing.watch((isEditing) => {
      if (isEditing) store.isMeasuring.value = false
      if (!isEditing) store.preview.value = null
      else if (!store.selection.value) store.selection.value = store.vehicle.value
    })
  }

  /** Names of all vehicles, then of all objects. */
  get names(): string[] {
    const frame = this.store.frame.value
    return frame ? [...Object.keys(frame.vehicles), ...Object.keys(frame.objects)] : []
  }

  /** Where the selected thing is shown; null if nothing is selected. */
  get selected(): Placement | null {
    return this.placement(this.store.selection.value)
  }

  get isBoxSelected(): boolean {
    return this.store.selection.value in (this.store.frame.value?.objects ?? {})
  }

  /** Where a thing is shown: its preview, or its pose in the latest Frame. */
  placement(name: string): Placement | null {
    const preview = this.store.preview.value
    if (preview?.name === name) return preview
    const frame = this.store.frame.value
    const pose = (frame?.vehicles[name] ?? frame?.objects[name])?.pose
    return pose ? { name, x: pose.position[0], y: pose.position[1], yaw: yawOf(pose) } : null
  }

  /** Shows the selected thing elsewhere, before `commit`. */
  show(change: Partial<Placement>): void {
    const selected = this.selected
    if (selected) this.store.preview.value = { ...selected, ...change }
  }

  /** Moves the preview by dx, dy [m] and turns it by an angle [rad]. */
  shift(dx: number, dy: number, turn: number): void {
    const selected = this.selected
    if (selected) this.show({ x: selected.x + dx, y: selected.y + dy, yaw: selected.yaw + turn })
  }

  /** Places the thing where the preview shows it. If that is refused, it is back where it was. */
  async commit(): Promise<void> {
    const preview = this.store.preview.value
    if (!preview) return
    const isPlaced = await this.actions.request({ type: 'Place', ...preview })
    if (isPlaced) await new Promise((resolve) => setTimeout(resolve, SETTLING))
    if (this.store.preview.value === preview) this.store.preview.value = null
  }

  /** Forgets the preview. */
  cancel(): void {
    this.store.preview.value = null
  }

  /** Adds a box at the free place nearest to x, y [m], and selects it. */
  async addBox(nearX: number, nearY: number): Promise<void> {
    const taken = this.names
    let number = 1
    while (taken.includes(`box_${number}`)) number++
    const name = `box_${number}`
    const [x, y] = this.freePlace(nearX, nearY)
    if (await this.actions.request({ type: 'AddBox', name, x, y, ...this.shape })) this.store.selection.value = name
  }

  async remove(): Promise<void> {
    if (this.isBoxSelected) await this.actions.request({ type: 'RemoveBox', name: this.store.selection.value })
  }

  undo(): void {
    if (this.store.status.value?.undo) void this.actions.request({ type: 'Undo' })
  }

  redo(): void {
    if (this.store.status.value?.redo) void this.actions.request({ type: 'Redo' })
  }

  setSensor(settings: Omit<SetSensor, 'type'>): Promise<boolean> {
    return this.actions.request({ type: 'SetSensor', ...settings })
  }

  /** Downloads the scenario as a YAML file. */
  async save(): Promise<void> {
    const text = await this.actions.textOf({ type: 'SaveScenario' })
    if (text) saveText(`${this.fileName()}.yaml`, text, 'application/yaml')
  }

  /** The place nearest to x, y [m] where the next box touches no vehicle and no object. */
  private freePlace(x: number, y: number): readonly [x: number, y: number] {
    const own = 0.5 * Math.hypot(...this.shape.size.slice(0, 2)) + GAP
    const obstacles = this.names.flatMap((name) => {
      const placed = this.placement(name)
      const extent = extentOf(this.store.scene.value, name)
      if (!placed || !extent) return []
      return [{ middle: middleOf(placed, extent), radius: own + 0.5 * Math.hypot(extent.size[0], extent.size[1]) }]
    })
    for (let ring = 0; ring < RINGS; ring++) {
      for (let i = 0; i < Math.max(1, 8 * ring); i++) {
        const angle = (2 * Math.PI * i) / (8 * ring || 1)
        const at = [x + ring * GRID * Math.cos(angle), y + ring * GRID * Math.sin(angle)] as const
        if (obstacles.every(({ middle, radius }) => Math.hypot(middle[0] - at[0], middle[1] - at[1]) > radius))
          return at
      }
    }
    return [x, y]
  }

  private fileName(): string {
    const name = this.store.scene.value?.scenario ?? 'scenario'
    return `${name.replace(/^.*[/\\]/, '').replace(/\.ya?ml$/, '')}_edited`.replace('_edited_edited', '_edited')
  }

  private checkSelection(frame: Frame | null): void {
    const name = this.store.selection.value
    if (frame && name && !(name in frame.vehicles) && !(name in frame.objects)) this.store.selection.value = ''
  }
}

/** Heading of a pose [rad]. */
export function yawOf({ orientation: [w, x, y, z] }: Pose): number {
  return Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
}
