// Points, lines and texts that programs draw into the scene.
import type { Drawing } from '../messages'
import type { Store } from '../store'
import { dot, letters, line, type Primitive, Strokes } from './strokes'

/** The simulator draws no more points, lines and characters. */
const MAX_PRIMITIVES = 10000
/** The colour of a drawing without one. */
const ORANGE: [number, number, number, number] = [1, 0.58, 0, 1]

export class DrawingView {
  private readonly strokes = new Strokes()
  readonly mesh = this.strokes.mesh
  private changes = -1
  /** The simulated time at which the next drawing disappears [s]. */
  private next = Number.POSITIVE_INFINITY

  /** Shows the drawings of the store that have not disappeared yet. */
  update(store: Store): void {
    const time = store.frame.value?.time ?? 0
    if (this.changes !== store.drawingChanges.value || time >= this.next) {
      this.changes = store.drawingChanges.value
      for (const [name, { until }] of store.drawings) if (until <= time) store.drawings.delete(name)
      this.next = Math.min(...[...store.drawings.values()].map(({ until }) => until), Number.POSITIVE_INFINITY)
      const all = [...store.drawings.values()].flatMap(({ drawing }) => (drawing ? primitives(drawing) : []))
      this.strokes.fill(all.slice(0, MAX_PRIMITIVES))
    }
    this.mesh.visible = store.areDrawingsShown.value && this.strokes.count > 0
  }

  dispose(): void {
    this.strokes.dispose()
  }
}

function primitives({ kind, points, text = '', color = ORANGE, size = 0 }: Drawing): Primitive[] {
  if (kind === 'points') return points.map((point) => dot(point, color, size))
  if (kind === 'text') return letters(text, points[0], color, size)
  const step = kind === 'path' ? 1 : 2
  const lines: Primitive[] = []
  for (let i = 0; i + 1 < points.length; i += step) lines.push(line(points[i], points[i + 1], color, size))
  return lines
}
