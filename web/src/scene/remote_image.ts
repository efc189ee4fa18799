// Shows images rendered by the simulator on top of the canvas.
import type { Rendered } from '../store'

export class RemoteImage {
  private readonly overlay = document.createElement('canvas')
  private readonly context = this.overlay.getContext('2d')
  /** Whether images are shown, and not the canvas below. */
  private isShown = false
  private isDecoding = false
  private next: Rendered | null = null
  /** Whether an image was shown since the simulator began to render. */
  hasImage = false
  /** Simulated time of the image that is shown [s]. */
  time = 0
  /** Called after each image that is shown. */
  onImage: () => void = () => {}

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.overlay.setAttribute('aria-hidden', 'true')
    // mouse events go to the canvas below
    const style = 'position:absolute;pointer-events:none;object-fit:cover;display:none'
    this.overlay.style.cssText = style
    canvas.after(this.overlay)
  }

  /** The canvas with the latest image. */
  get image(): HTMLCanvasElement {
    return this.overlay
  }

  /** Waits for images; what the canvas shows stays visible until the first one. */
  start(): void {
    this.hasImage = false
  }

  /** Shows the canvas below until the next image. */
  uncover(): void {
    this.overlay.style.display = 'none'
    this.hasImage = false
  }

  /** Shows the canvas below, and drops images that are not decoded yet. */
  hide(): void {
    this.uncover()
    this.isShown = false
    this.next = null
  }

  resize(): void {
    const { canvas } = this
    const { offsetLeft: left, offsetTop: top, clientWidth: width, clientHeight: height } = canvas
    const box = { left, top, width, height }
    for (const [side, value] of Object.entries(box)) this.overlay.style.setProperty(side, `${value}px`)
  }

  /** Shows an image. If images arrive faster than they are decoded, only the latest is shown. */
  show(image: Rendered): void {
    this.next = image
    this.isShown = true
    if (!this.isDecoding) void this.decode()
  }

  private async decode(): Promise<void> {
    this.isDecoding = true
    while (this.next) {
      const { jpeg, time } = this.next
      this.next = null
      const bitmap = await createImageBitmap(new Blob([jpeg as Uint8Array<ArrayBuffer>], { type: 'image/jpeg' })).catch(
        () => null, // skip an image that cannot be decoded
      )
      if (!bitmap || !this.isShown) continue
      if (this.overlay.width !== bitmap.width) this.overlay.width = bitmap.width
      if (this.overlay.height !== bitmap.height) this.overlay.height = bitmap.height
      this.context?.drawImage(bitmap, 0, 0)
      bitmap.close()
      if (!this.hasImage) this.resize()
      this.hasImage = true
      this.time = time
      this.overlay.style.display = 'block'
      this.onImage()
    }
    this.isDecoding = false
  }

  dispose(): void {
    this.overlay.remove()
  }
}
