// The 2D context of a canvas at the resolution of the screen.

/** A context in CSS pixels, and the size of its canvas. */
export interface Context2D {
  context: CanvasRenderingContext2D
  width: number
  height: number
}

/** Fits a canvas to the resolution of the screen, and clears it; null while it has no size. */
export function contextOf(canvas: HTMLCanvasElement): Context2D | null {
  const width = canvas.clientWidth
  const height = canvas.clientHeight
  const context = canvas.getContext('2d')
  if (!context || width === 0 || height === 0) return null
  const ratio = Math.min(window.devicePixelRatio || 1, 2)
  const pixels = [Math.round(width * ratio), Math.round(height * ratio)] as const
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels
  context.setTransform(ratio, 0, 0, ratio, 0, 0)
  context.clearRect(0, 0, width, height)
  return { context, width, height }
}
