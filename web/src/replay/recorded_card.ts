// The card after a recording: shows it, films it, downloads it, without a terminal.
import type { Actions } from '../actions'
import { sentence } from '../actions'
import { h, setText } from '../panels/element'
import { busy } from '../panels/pending'
import { sceneUrl } from '../scene/assets'
import type { Store } from '../store'
import { openReplay } from './open_replay'

export interface RecordedCard {
  element: HTMLElement
  /** Shows the card of the recording that has just been completed; `duration`: simulated time in it [s]. */
  show: (duration: number) => void
}

export function recordedCard(store: Store, actions: Actions): RecordedCard {
  const text = h('span', { testid: 'recorded-text' })
  const state = h('span', { class: 'recorded-state', testid: 'recorded-state', role: 'status' })
  const replay = h(
    'button',
    { class: 'primary', testid: 'recorded-replay', onclick: () => void busy(replay, () => openReplay(store, actions)) },
    'Replay',
  )
  const film = h('button', { testid: 'recorded-film', onclick: () => void busy(film, startFilm) }, 'Film')
  const download = h('button', { testid: 'recorded-download', onclick: () => save(name) }, 'Download')
  const close = h('button', { testid: 'recorded-close', onclick: () => (element.hidden = true) }, 'Close')
  const buttons = h('div', { class: 'row' }, replay, film, download, close)
  const element = h('div', { class: 'hint recorded', testid: 'recorded', hidden: true }, text, buttons, state)
  let name = ''
  let duration = 0
  let isFilming = false
  let isAwaited = false

  async function startFilm(): Promise<void> {
    const isScene = store.camera.value === "Driver's Eye" || store.camera.value === "Bird's Eye"
    const camera = isScene || store.camera.value === "God's Eye" ? store.camera.value : "Driver's Eye"
    await actions.textOf({ type: 'FilmRecording', camera, vehicle: store.vehicle.value || null })
  }

  function save(file: string): void {
    const link = h('a', { href: sceneUrl(`recordings/${encodeURIComponent(file)}`).href, download: file })
    document.body.append(link)
    link.click()
    link.remove()
  }

  store.status.watch((status) => {
    if (!status) return
    const now = status.recording
    if (isAwaited && now.download) {
      isAwaited = false
      name = now.download
      setText(text, `Recorded ${name}, ${Math.round(duration)} s.`)
      element.hidden = false
    }
    const { state: step, share, error } = now.film
    if (isFilming && step === 'done') {
      save(now.film.name)
      store.notice.value = `Saved ${now.film.name}.`
    }
    isFilming = step === 'filming'
    film.disabled = isFilming
    film.title = isFilming ? 'A film is being made.' : 'Film it with the present camera, and download the film (WebM)'
    setText(state, isFilming ? `Filming: ${Math.round(100 * share)} %` : error ? sentence(error) : '')
    state.hidden = !state.textContent
  })

  return {
    element,
    show(seconds) {
      duration = seconds
      isAwaited = true
    },
  }
}
