// A dial of 24 hours with noon on top. Its ring has the colours of the sky at each hour.

import { clockTime, h, setText } from './element'

/** Step of the arrow keys, and of Page Up and Page Down [min]. */
const STEP = 5
const PAGE = 60
export const DAY = 24 * 60
/** The dial shows what the user has set for so long [ms]: Frames with the new value come later. */
const REST = 700
const KEYS = 'Time of day: arrow keys 5 minutes, Page keys 1 hour'

export interface Dial {
  element: HTMLElement
  /** Shows a time [min since midnight], or a fixed light by its name. */
  show: (minutes: number, light?: string) => void
  /** Paints the ring: CSS colours at equal distances from midnight to midnight. */
  paint: (colours: readonly string[]) => void
  /** Marks sunrise and sunset [min since midnight]. */
  mark: (rise: number, set: number) => void
}

/** `choose` gets the minutes since midnight that the user selects. */
export function dial(choose: (minutes: number) => void): Dial {
  const ring = h('span', { class: 'dial-ring' })
  const hand = h('span', { class: 'dial-hand' })
  const marks = [0, 1].map(() => h('span', { class: 'dial-mark' }))
  const text = h('span', { class: 'dial-text', testid: 'time-of-day-text' })
  let minutes = DAY / 2
  let moved = -REST
  const element = h(
    'div',
    {
      ...{ class: 'dial', testid: 'time-of-day', role: 'slider', tabindex: 0, 'aria-label': 'Time of day' },
      ...{ 'aria-valuemin': 0, 'aria-valuemax': DAY - 1, title: KEYS },
      onkeydown: (event: KeyboardEvent) => key(event),
      onpointerdown: (event: PointerEvent) => {
        element.setPointerCapture(event.pointerId)
        point(event)
      },
      onpointermove: (event: PointerEvent) => {
        if (element.hasPointerCapture(event.pointerId)) point(event)
      },
    },
    ring,
    ...marks,
    hand,
    text,
  )

  function select(wanted: number): void {
    moved = performance.now()
    draw(((wanted % DAY) + DAY) % DAY)
    setText(text, clockTime(minutes))
    choose(minutes)
  }

  function key(event: KeyboardEvent): void {
    const steps = { ArrowRight: STEP, ArrowUp: STEP, ArrowLeft: -STEP, ArrowDown: -STEP, PageUp: PAGE, PageDown: -PAGE }
    const ends = { Home: 0, End: DAY - STEP }
    if (event.key in steps) {
      const step = steps[event.key as keyof typeof steps]
      select(STEP * Math.round((minutes + step) / STEP))
    } else if (event.key in ends) select(ends[event.key as keyof typeof ends])
    else return
    event.preventDefault()
    event.stopPropagation() // arrow keys drive, too
  }

  function point(event: PointerEvent): void {
    const { left, top, width, height } = element.getBoundingClientRect()
    const [right, down] = [event.clientX - left - width / 2, event.clientY - top - height / 2]
    const turn = Math.atan2(-right, down) / (2 * Math.PI) // from midnight, which is below, clockwise
    select(STEP * Math.round((turn * DAY) / STEP))
  }

  function draw(wanted: number): void {
    minutes = wanted
    hand.style.rotate = angle(minutes)
    element.setAttribute('aria-valuenow', String(Math.round(minutes)))
    element.setAttribute('aria-valuetext', clockTime(minutes))
  }

  draw(minutes)
  return {
    element,
    show: (shown, light) => {
      element.classList.toggle('fixed', light !== undefined)
      if (performance.now() - moved < REST) return
      draw(shown)
      setText(text, light ?? clockTime(shown))
      element.title = light === undefined ? KEYS : `${light}, a fixed light. Drag the hand to choose a time. ${KEYS}`
    },
    paint: (colours) => (ring.style.backgroundImage = `conic-gradient(from 180deg, ${colours.join(', ')})`),
    mark: (...times) => {
      for (const [i, one] of times.entries()) {
        marks[i].style.rotate = angle(one)
        marks[i].title = `${['Sunrise', 'Sunset'][i]} ${clockTime(one)}`
      }
    },
  }
}

/** Of a time on the dial, clockwise from its top. */
function angle(minutes: number): string {
  return `${(360 * minutes) / DAY + 180}deg`
}
