// Edits of the scenario: the selected vehicle or object, its preview while it is moved, and the requests.
import { type Actions, sentence } from '../actions'
import type { Frame, Pose, ServerOperation, SetSensor } from '../messages'
import { Observable } from '../observable'
import { stem } from '../scenario_title'
import type { Placement, Store } from '../store'
import { extentOf, middleOf, poseOf } from './outline'
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
  /** The shape of the next box; it goes back to that of the latest box if the simulator refuses it. */
  readonly shape = new Observable<BoxShape>({ size: [0.1, 0.1, 0.1], mass: 0.1 })
  private accepted = this.shape.value

  constructor(
    private readonly store: Store,
    private readonly actions: Actions,
  ) {
    store.frame.watch((frame) => this.checkSelection(frame))
    let latest = ''
    store.status.watch((status) => {
      const undo = status?.undo ?? ''
      if (undo !== latest) store.hasUnsavedEdits.value = undo !== ''
      latest = undo
    })
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

  /** The pose in which a thing is shown. */
  pose(name: string): Pose | null {
    const preview = this.store.preview.value
    const extent = extentOf(this.store.scene.value, name)
    if (preview?.name === name) return extent && poseOf(preview, extent)
    const frame = this.store.frame.value
    return (frame?.vehicles[name] ?? frame?.objects[name])?.pose ?? null
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

  /** Places the thing where the preview shows it, in the view. If that is refused, it is back where it was. */
  async commit(): Promise<void> {
    const preview = this.store.preview.value
    if (!preview) return
    if (await this.edit({ type: 'Place', ...preview })) {
      this.actions.view?.showPlace(preview.x, preview.y)
      await new Promise((resolve) => setTimeout(resolve, SETTLING))
    }
    if (this.store.preview.value === preview) this.store.preview.value = null
  }

  /** Moves the view to the selected thing, if it is not visible; not in Build mode. */
  showSelected(): void {
    if (this.selected && this.store.isEditing.value) this.actions.view?.showPlace(this.selected.x, this.selected.y)
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
    const shape = this.shape.value
    if (!(await this.edit({ type: 'AddBox', name, x, y, ...shape }))) {
      this.shape.value = this.accepted
      return
    }
    this.accepted = shape
    this.store.selection.value = name
  }

  async remove(): Promise<void> {
    if (this.isBoxSelected) await this.edit({ type: 'RemoveBox', name: this.store.selection.value })
  }

  async undo(): Promise<void> {
    if (this.store.status.value?.undo && (await this.edit({ type: 'Undo' }))) this.showSelected()
  }

  async redo(): Promise<void> {
    if (this.store.status.value?.redo && (await this.edit({ type: 'Redo' }))) this.showSelected()
  }

  setSensor(settings: Omit<SetSensor, 'type'>): Promise<boolean> {
    return this.edit({ type: 'SetSensor', ...settings })
  }

  /** Downloads the scenario as a YAML file with that title; returns whether it could. */
  async save(title: string, name: string): Promise<boolean> {
    const text = await this.actions.textOf({ type: 'SaveScenario', title })
    if (text === null) return false
    saveText(`${stem(name)}.yaml`, text, 'application/yaml')
    this.store.hasUnsavedEdits.value = false
    return true
  }

  /** Name of the file of the edited scenario, without its ending. */
  get fileName(): string {
    const name = this.store.scene.value?.scenario ?? 'scenario'
    return `${stem(name)}_edited`.replace('_edited_edited', '_edited')
  }

  /** Requests an edit; shows what the simulator says about it, and returns whether it was made. */
  private async edit(operation: ServerOperation): Promise<boolean> {
    const text = await this.actions.textOf(operation)
    if (text) this.store.warning.value = sentence(text)
    if (text !== null) this.store.hasUnsavedEdits.value = true
    return text !== null
  }

  /** The place nearest to x, y [m] where the next box touches no vehicle and no object. */
  private freePlace(x: number, y: number): readonly [x: number, y: number] {
    const own = 0.5 * Math.hypot(...this.shape.value.size.slice(0, 2)) + GAP
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

  private checkSelection(frame: Frame | null): void {
    const name = this.store.selection.value
    if (frame && name && !(name in frame.vehicles) && !(name in frame.objects)) this.store.selection.value = ''
  }
}

/** Heading of a pose [rad]. */
export function yawOf({ orientation: [w, x, y, z] }: Pose): number {
  return Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
}
