// Pictures that the simulator drew, over the canvas, for machines that cannot draw themselves.
import type { Rendered } from '../store'

export class StreamView {
  private readonly overlay = document.createElement('canvas')
  private readonly context = this.overlay.getContext('2d')
  private isDecoding = false
  private next: Rendered | null = null
  /** Called with each picture that is shown. */
  onPicture: () => void = () => {}

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.overlay.setAttribute('aria-hidden', 'true')
    // the person's mouse still means the canvas below
    const style = 'position:absolute;pointer-events:none;object-fit:cover;display:none'
    this.overlay.style.cssText = style
    canvas.after(this.overlay)
  }

  set isShown(is: boolean) {
    this.overlay.style.display = is ? 'block' : 'none'
    if (is) this.resize()
    else this.next = null
  }

  resize(): void {
    const { canvas } = this
    const { offsetLeft: left, offsetTop: top, clientWidth: width, clientHeight: height } = canvas
    const box = { left, top, width, height }
    for (const [side, value] of Object.entries(box)) this.overlay.style.setProperty(side, `${value}px`)
  }

  /** Shows that picture; if pictures come faster than they can be shown, the latest. */
  show(picture: Rendered): void {
    this.next = picture
    if (!this.isDecoding) void this.decode()
  }

  private async decode(): Promise<void> {
    this.isDecoding = true
    while (this.next) {
      const { jpeg } = this.next
      this.next = null
      const image = await createImageBitmap(new Blob([jpeg as Uint8Array<ArrayBuffer>], { type: 'image/jpeg' })).catch(
        () => null, // a broken picture is followed by a whole one
      )
      if (!image) continue
      if (this.overlay.width !== image.width) this.overlay.width = image.width
      if (this.overlay.height !== image.height) this.overlay.height = image.height
      this.context?.drawImage(image, 0, 0)
      image.close()
      this.onPicture()
    }
    this.isDecoding = false
  }

  dispose(): void {
    this.overlay.remove()
  }
}
