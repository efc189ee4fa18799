// The Film button: records the 3D view in the browser, in a video file with a codec that needs no licence.
import { h, setText } from '../panels/element'
import type { Store } from '../store'

/** In the order of preference. */
const TYPES = ['video/webm;codecs=av01', 'video/webm;codecs=vp9', 'video/webm;codecs=vp8']
/** Images per second at most. */
const RATE = 30
/** [bit/s] */
const BITRATE = 8_000_000

/** A button that starts a film of the canvas, and downloads it when it is pressed again. */
export function filmButton(store: Store, canvas: HTMLCanvasElement): HTMLElement {
  const title = 'Film the view in this browser; the second press downloads the film (WebM)'
  const button = h('button', { testid: 'film', title, onclick: () => (recorder ? recorder.stop() : start()) }, 'Film')
  let recorder: MediaRecorder | null = null

  function start(): void {
    const type = globalThis.MediaRecorder && TYPES.find((one) => MediaRecorder.isTypeSupported(one))
    if (!type || store.quality.value === 'stream') {
      store.warning.value = type
        ? 'The simulator renders this view. Choose another quality, or use: autodrive film.'
        : 'This browser cannot film. Use: autodrive film.'
      return
    }
    const stream = canvas.captureStream(RATE)
    const parts: Blob[] = []
    recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: BITRATE })
    recorder.ondataavailable = ({ data }) => parts.push(data)
    recorder.onstop = () => {
      for (const track of stream.getTracks()) track.stop()
      recorder = null
      show()
      save(new Blob(parts, { type: 'video/webm' }))
    }
    recorder.start(1000)
    show()
  }

  function save(film: Blob): void {
    const link = document.createElement('a')
    link.href = URL.createObjectURL(film)
    link.download = `${store.scene.value?.scenario}-${store.frame.value?.time.toFixed(2)}s.webm`
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000)
    store.notice.value = `Saved ${link.download}.`
  }

  function show(): void {
    button.setAttribute('aria-pressed', String(recorder !== null))
    setText(button, recorder ? 'Stop the film' : 'Film')
  }
  show()
  return button
}
