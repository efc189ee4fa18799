// Driving with the fingers: a pad that steers, a pad that drives, and the lamps; shown where the pointer is a finger.
import { Headlights, Indicators } from '../messages'
import type { Driver, Wish } from '../driving/driver'
import { h } from './element'

export function touch(driver: Driver): HTMLElement {
  const lamps: [string, string, () => void][] = [
    ['Low beam', '◐', () => driver.toggleHeadlights(Headlights.LOW)],
    ['High beam', '●', () => driver.toggleHeadlights(Headlights.HIGH)],
    ['Left indicator', '◀', () => driver.toggleIndicators(Indicators.LEFT)],
    ['Hazard indicators', '▲', () => driver.toggleIndicators(Indicators.HAZARD)],
    ['Right indicator', '▶', () => driver.toggleIndicators(Indicators.RIGHT)],
  ]
  return h(
    'div',
    { class: 'touch', testid: 'touch' },
    pad(driver, 'steering', 'Steering'),
    h(
      'div',
      { class: 'touch-lamps' },
      ...lamps.map(([label, sign, press]) => h('button', { 'aria-label': label, title: label, onclick: press }, sign)),
    ),
    pad(driver, 'throttle', 'Throttle'),
  )
}

/** A pad with a knob that follows the finger along one direction and returns when it is let go. */
function pad(driver: Driver, axis: keyof Wish, label: string): HTMLElement {
  const knob = h('i', { class: 'knob' })
  const element = h('div', { class: `pad ${axis}`, testid: `pad-${axis}`, 'aria-label': label }, knob)

  /** `value` [-1, 1], up or left positive. */
  function set(value: number): void {
    driver.touch[axis] = value
    knob.style.setProperty('--offset', String(-value))
    driver.change()
  }

  function follow(event: PointerEvent): void {
    if (!element.hasPointerCapture(event.pointerId)) return
    const box = element.getBoundingClientRect()
    const [size, offset] =
      axis === 'steering' ? [box.width, event.clientX - box.left] : [box.height, event.clientY - box.top]
    const reach = size / 2 - knob.offsetWidth / 2
    set(Math.max(-1, Math.min(1, (size / 2 - offset) / reach)))
  }

  element.addEventListener('pointerdown', (event) => {
    event.preventDefault()
    element.setPointerCapture(event.pointerId)
    follow(event)
  })
  element.addEventListener('pointermove', follow)
  element.addEventListener('lostpointercapture', () => set(0))
  return element
}
