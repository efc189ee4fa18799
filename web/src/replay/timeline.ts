// The timeline of a recording: scrubber with the marks of events, playing, steps, jumps, and plots of the whole run.
import './replay.css'

import type { Actions } from '../actions'
import { sentence } from '../actions'
import type { Connection } from '../connection'
import { keyText } from '../driving/key_caps'
import { describe } from '../log'
import type { Curve } from '../messages'
import { h, icon, setText } from '../panels/element'
import { choice } from '../panels/fields'
import { NEXT_EVENT, PAUSE, PLAY, PLOT, PREVIOUS_EVENT, STEP, STEP_BACK } from '../panels/icons'
import { loadPreference, savePreference } from '../panels/preferences'
import type { Store } from '../store'
import { marksCanvas, preciseClock, textAt } from './marks'
import { Playhead } from './playhead'
import { type RunPlot, runPlot } from './run_plot'
import { TimeWindow } from './window'

const SPEEDS = ['0.1', '0.25', '0.5', '1', '2', '4', '8', '16', '64']
/** Delay before the curves of another window are requested [ms]. */
const DELAY = 120
/** While the simulator has not read the whole recording yet, the curves are requested again after this time [ms]. */
const RETRY = 1500
/** Steps of the arrow keys [s]. */
const ARROW = 1
const PAGE = 10

export function timeline(store: Store, connection: Connection, actions: Actions): HTMLElement {
  const playhead = new Playhead(store, connection, (error) => (store.error.value = sentence(error)))
  const window_ = new TimeWindow()
  const marks = marksCanvas(window_)
  const cursor = h('div', { class: 'timeline-cursor' })
  const hover = h('output', { class: 'timeline-hover', testid: 'timeline-hover', hidden: true })
  const label = { 'aria-label': 'Time of the recording', 'aria-valuemin': 0 }
  const slider = h('div', { testid: 'timeline', role: 'slider', tabindex: 0, ...label }, marks.element)
  const plot = runPlot(() => requestCurves())
  const track = h('div', { class: 'timeline-track' }, plot.element, slider, cursor, hover)
  const play = button('play', PLAY, 'Play', () => actions.togglePause())
  const time = h('output', { class: 'timeline-time', testid: 'timeline-time' })
  const file = h('span', { class: 'timeline-file', testid: 'timeline-file' })
  const speed = choice('timeline-speed', (value) => void actions.request({ type: 'SetSpeed', factor: Number(value) }), {
    'aria-label': 'Speed',
    title: 'Speed',
  })
  speed.append(...SPEEDS.map((value) => h('option', { value }, `${value} ×`)))
  const whole = h(
    'button',
    { testid: 'timeline-whole', title: 'Show the whole recording', onclick: () => showAll() },
    'All',
  )
  const plotButton = button('timeline-plot', PLOT, 'Plots of the whole recording', () =>
    showPlot(plot.element.hidden === true),
  )
  const controls = h(
    'div',
    { class: 'timeline-controls', role: 'toolbar', 'aria-label': 'Replay' },
    button('previous-event', PREVIOUS_EVENT, 'Event before (Page up)', () => jump(-1)),
    button('step-back', STEP_BACK, 'One Frame back (comma)', () => void actions.step(-1)),
    play,
    button('step-forward', STEP, 'One Frame on (full stop)', () => void actions.step(1)),
    button('next-event', NEXT_EVENT, 'Next event (Page down)', () => jump(1)),
    time,
    speed,
    file,
    whole,
    plotButton,
  )
  const element = h(
    'section',
    { class: 'timeline', testid: 'timeline-bar', 'aria-label': 'Timeline', hidden: true },
    track,
    controls,
  )
  const isShown = () => playhead.timeline !== null
  let timer = 0

  // -- what the server sends ---------------------------------------------------------------------------------------

  store.scene.watch((scene) => {
    const { timeline: recording = null } = scene ?? {}
    element.hidden = !recording
    document.documentElement.toggleAttribute('data-replay', recording !== null)
    if (!recording) return
    setText(file, recording.name)
    file.title = recording.name
    slider.setAttribute('aria-valuemax', recording.duration.toFixed(2))
    if (window_.range.value.end === 1 || window_.isWhole) window_.showAll(recording.duration)
    requestCurves()
  })
  store.status.watch((status) => {
    if (!status || !isShown()) return
    play.replaceChildren(icon(status.is_paused ? PLAY : PAUSE))
    const label = status.is_paused ? 'Play' : 'Pause'
    play.setAttribute('aria-label', label)
    play.title = keyText(`${label} ({KeyP})`)
    if (document.activeElement !== speed) showSpeed(status.speed ?? 1)
  })
  store.vehicle.watch(() => requestCurves())
  window_.range.watch(() => {
    whole.hidden = window_.isWhole
    draw()
    requestCurves()
  })

  function showSpeed(value: number): void {
    const text = String(value)
    if (![...speed.options].some((option) => option.value === text))
      speed.append(h('option', { value: text }, `${text} ×`))
    speed.value = text
  }

  // -- drawing -----------------------------------------------------------------------------------------------------

  function draw(): void {
    marks.draw(playhead.timeline?.marks ?? [])
    showPosition()
  }

  function showPosition(): void {
    const recording = playhead.timeline
    if (!recording) return
    const position = playhead.position
    setText(time, `${preciseClock(position)} / ${preciseClock(recording.duration)}`)
    const share = window_.shareOf(position)
    cursor.hidden = share < 0 || share > 1
    cursor.style.setProperty('--share', String(share))
    slider.setAttribute('aria-valuenow', position.toFixed(2))
    slider.setAttribute('aria-valuetext', preciseClock(position))
  }

  const animate = (): void => {
    requestAnimationFrame(animate)
    if (!isShown() || document.hidden) return
    if (!store.status.value?.is_paused && !isDragged) window_.follow(playhead.position)
    showPosition()
  }
  requestAnimationFrame(animate)
  const resized = new ResizeObserver(() => {
    document.documentElement.style.setProperty('--timeline', `${element.offsetHeight}px`)
    draw()
    requestCurves()
  })
  resized.observe(element)

  // -- plots ---------------------------------------------------------------------------------------------------------

  function showPlot(isOpen: boolean): void {
    plot.element.hidden = !isOpen
    plotButton.setAttribute('aria-pressed', String(isOpen))
    savePreference('run-plot', isOpen ? 'open' : 'closed')
    requestCurves()
  }

  function requestCurves(delay = DELAY): void {
    window.clearTimeout(timer)
    if (isShown() && !plot.element.hidden) timer = window.setTimeout(() => void fetchCurves(plot), delay)
  }

  async function fetchCurves({ wanted, show }: RunPlot): Promise<void> {
    const range = window_.range.value
    const columns = Math.min(Math.max(marks.element.clientWidth, 1), 4096)
    let curves: Record<string, Curve> = {}
    try {
      const request = { vehicle: store.vehicle.value, plots: wanted, start: range.start, end: range.end, columns }
      const response = await connection.request({ type: 'PlotRecording', ...request })
      curves = response.curves
      if (response.text) requestCurves(RETRY) // the simulator still reads the recording
    } catch (error) {
      store.error.value = sentence(error)
    }
    if (range === window_.range.value) show(curves, range)
  }

  // -- inputs --------------------------------------------------------------------------------------------------------

  let isDragged = false
  const shareAt = (event: MouseEvent): number => {
    const { left, width } = marks.element.getBoundingClientRect()
    return Math.min(Math.max((event.clientX - left) / width, 0), 1)
  }
  track.addEventListener('pointerdown', (event) => {
    if (event.button !== 0 || (event.target as Element).closest('select')) return
    isDragged = true
    track.setPointerCapture(event.pointerId)
    playhead.seek(window_.timeAt(shareAt(event)))
  })
  track.addEventListener('pointermove', (event) => {
    const share = shareAt(event)
    if (isDragged) playhead.seek(window_.timeAt(share))
    hover.hidden = false
    hover.style.setProperty('--share', String(share))
    setText(hover, textAt(store.scene.value, window_, share, marks.element.clientWidth))
  })
  const release = (): void => {
    isDragged = false
  }
  track.addEventListener('pointerup', release)
  track.addEventListener('pointercancel', release)
  track.addEventListener('pointerleave', () => (hover.hidden = true))
  track.addEventListener('dblclick', () => showAll())
  track.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault()
      window_.zoom(-Math.sign(event.deltaY), shareAt(event))
    },
    { passive: false },
  )
  track.addEventListener('keydown', (event) => {
    const position = playhead.position
    const targets: Record<string, number> = {
      ArrowLeft: position - (event.shiftKey ? PAGE : ARROW),
      ArrowRight: position + (event.shiftKey ? PAGE : ARROW),
      Home: 0,
      End: playhead.timeline?.duration ?? 0,
    }
    if (!(event.key in targets) || (event.target as Element).closest('select')) return
    event.preventDefault()
    event.stopPropagation()
    playhead.seek(targets[event.key])
    window_.follow(playhead.position)
  })

  function showAll(): void {
    window_.showAll(playhead.timeline?.duration ?? 1)
  }

  function jump(direction: 1 | -1): void {
    const mark = playhead.jump(direction)
    if (mark) window_.follow(mark.time)
    store.notice.value = mark
      ? `${preciseClock(mark.time)} ${describe(mark.event, store.scene.value)[0]}.`
      : direction > 0
        ? 'There is no later event.'
        : 'There is no earlier event.'
  }

  const keys: Record<string, () => void> = {
    Comma: () => void actions.step(-1),
    Period: () => void actions.step(1),
    PageUp: () => jump(-1),
    PageDown: () => jump(1),
  }
  window.addEventListener('keydown', (event) => {
    const isField = event.target instanceof Element && event.target.closest('input, select, textarea, dialog')
    if (!isShown() || isField || event.ctrlKey || event.altKey || event.metaKey) return
    const run = keys[event.code]
    if (!run) return
    event.preventDefault()
    run()
  })
  showPlot(loadPreference('run-plot') === 'open')
  return element
}

function button(testid: string, path: string, label: string, onclick: () => void): HTMLButtonElement {
  return h(
    'button',
    { testid, type: 'button', class: 'square', title: label, 'aria-label': label, onclick },
    icon(path),
  )
}
