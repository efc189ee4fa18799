// Recording of the simulation: the button in the toolbar, and the section of the menu.
import './replay.css'

import type { Actions } from '../actions'
import type { RecordingStatus } from '../messages'
import { h, icon, setText } from '../panels/element'
import { choice, labelled, section } from '../panels/fields'
import { clock } from '../panels/hud_rows'
import { RECORD } from '../panels/icons'
import { busy, disableWhenRefused } from '../panels/pending'
import { loadPreference, savePreference } from '../panels/preferences'
import type { Store } from '../store'
import { recordedCard } from './recorded_card'

/** What is kept: everything, or the last seconds until they are saved. */
const KEPT: Record<string, string> = {
  all: 'Everything',
  30: 'Last 30 s',
  120: 'Last 2 min',
  600: 'Last 10 min',
}

export interface Recorder {
  /** For the toolbar. */
  button: HTMLElement
  /** For the touch controls. */
  touchButton: HTMLElement
  /** For the menu. */
  section: HTMLElement
  /** What to do with the recording that is complete. */
  card: HTMLElement
}

export function recorder(store: Store, actions: Actions): Recorder {
  const time = h('span', { class: 'recording-time' })
  const button = h(
    'button',
    { class: 'record', testid: 'record-button', onclick: () => void toggle() },
    icon(RECORD),
    h('span', { class: 'record-label' }, 'Record'),
    time,
  )
  const touchButton = h(
    'button',
    { class: 'record', testid: 'touch-record', onclick: () => void toggle() },
    icon(RECORD),
  )
  const start = h('button', { testid: 'record', onclick: () => void toggle() })
  const save = h('button', { testid: 'save-recording', onclick: () => void busy(save, saveKept) }, 'Save')
  const keep = choice('recording-keep', (value) => savePreference('recording-keep', value))
  keep.append(...Object.entries(KEPT).map(([value, label]) => h('option', { value }, label)))
  const known = loadPreference('recording-keep')
  keep.value = known !== null && known in KEPT ? known : 'all'
  const state = h('p', { class: 'note', testid: 'recording-state', role: 'status', hidden: true })
  const error = h('p', { class: 'error', testid: 'recording-error', role: 'alert', hidden: true })

  const status = () => store.status.value?.recording
  const isOn = () => (status()?.state ?? 'off') !== 'off'

  const card = recordedCard(store, actions)
  const buttons = [button, touchButton, start]
  for (const each of buttons) disableWhenRefused(store, each, 'StartRecording')
  const toggle = () => busy(buttons, startOrStop)

  async function startOrStop(): Promise<void> {
    if (!isOn()) {
      const seconds = Number(keep.value)
      const request = { type: 'StartRecording', keep: Number.isNaN(seconds) ? null : seconds } as const
      if (await actions.request(request)) await nextStatus(store)
      return
    }
    const { duration = 0 } = status() ?? {}
    const file = await actions.textOf({ type: 'StopRecording' })
    if (file) card.show(duration)
    if (file !== null) await nextStatus(store)
  }

  async function saveKept(): Promise<void> {
    const file = await actions.textOf({ type: 'SaveRecording' })
    if (file) card.show(status()?.duration ?? 0)
  }

  store.status.watch((now) => {
    const recording = now?.recording
    const isRecording = isOn()
    for (const one of buttons) one.setAttribute('aria-pressed', String(isRecording))
    const label = isRecording ? 'Stop the recording' : 'Record the simulation'
    for (const one of [button, touchButton]) {
      if (!one.disabled) one.title = label
      one.setAttribute('aria-label', label)
      one.classList.toggle('is-keeping', recording?.state === 'keeping')
    }
    setText(start, isRecording ? 'Stop recording' : 'Record')
    setText(time, isRecording ? clock(recording?.duration ?? 0) : '')
    save.hidden = recording?.state !== 'keeping'
    keep.disabled = isRecording
    show(state, recording ? text(recording) : '')
    show(error, recording?.error ?? '')
  })
  return {
    button,
    touchButton,
    card: card.element,
    section: section('Recording', h('div', { class: 'tools' }, start, save), labelled('Keep', keep), state, error),
  }
}

/** Waits for the Status that shows what a request has done: until then, the button would ask for the same again. */
function nextStatus(store: Store): Promise<void> {
  const before = store.status.value
  return new Promise((resolve) => {
    const stop = store.status.watch((status) => {
      if (status === before) return
      queueMicrotask(() => stop())
      resolve()
    })
  })
}

function text({ state, file, duration, size, dropped }: RecordingStatus): string {
  const lost = dropped > 0 ? `, ${dropped} images or scans were dropped` : ''
  const amount = `${clock(duration)}, ${(size / 1e6).toFixed(1)} MB${lost}`
  if (state === 'recording') return `Recording ${file}: ${amount}.`
  if (state === 'keeping') return `Keeping the last seconds: ${amount}.`
  return file ? `Last file: ${file}` : ''
}

function show(element: HTMLElement, text: string): void {
  setText(element, text)
  element.hidden = !text
}
