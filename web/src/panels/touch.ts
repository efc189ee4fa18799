// Touch controls: a pad for steering, a pad for throttle, and lamp buttons; shown on touch screens.

import type { Driver } from '../driving/driver'
import type { Lights } from '../messages'
import { Headlights, Indicators } from '../messages'
import type { Store } from '../store'
import type { DriveInput } from '../worker/port'
import { h, icon } from './element'
import { HAZARD, HIGH_BEAM, LEFT_INDICATOR, LOW_BEAM, RIGHT_INDICATOR } from './icons'

export function touch(driver: Driver, store: Store): HTMLElement {
  const beam = (label: string, path: string, which: Headlights) =>
    lamp(
      store,
      label,
      path,
      (lights) => lights.headlights === which,
      () => driver.toggleHeadlights(which),
    )
  const side = (label: string, path: string, which: Indicators) =>
    lamp(
      store,
      label,
      path,
      (lights) => lights.indicators === which,
      () => driver.toggleIndicators(which),
    )
  return h(
    'section',
    { class: 'touch', testid: 'touch', 'aria-label': 'Touch controls' },
    pad(driver, 'steering', 'Steering'),
    h(
      'div',
      { class: 'touch-lamps' },
      beam('Low beam', LOW_BEAM, Headlights.LOW),
      beam('High beam', HIGH_BEAM, Headlights.HIGH),
      side('Left indicator', LEFT_INDICATOR, Indicators.LEFT),
      side('Hazard indicators', HAZARD, Indicators.HAZARD),
      side('Right indicator', RIGHT_INDICATOR, Indicators.RIGHT),
    ),
    pad(driver, 'throttle', 'Throttle'),
  )
}

/** A button that switches a lamp and shows its state. */
function lamp(
  store: Store,
  label: string,
  path: string,
  isOn: (lights: Lights) => boolean,
  press: () => void,
): HTMLElement {
  const button = h('button', { 'aria-label': label, title: label, onclick: press }, icon(path))
  store.frame.watch((frame) => {
    const vehicle = frame?.vehicles[store.vehicle.value]
    const pressed = String(vehicle ? isOn(vehicle.lights) : false)
    if (button.getAttribute('aria-pressed') !== pressed) button.setAttribute('aria-pressed', pressed)
  })
  return button
}

/** A pad with a knob that follows the finger along one axis and returns to the centre on release. */
function pad(driver: Driver, axis: keyof DriveInput, label: string): HTMLElement {
  const knob = h('i', { class: 'knob' })
  const element = h('div', { class: `pad ${axis}`, testid: `pad-${axis}`, role: 'group', 'aria-label': label }, knob)

  /** `value` in [-1, 1]; up and left are positive. */
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
