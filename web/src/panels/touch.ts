// Touch controls: pads for steering and throttle, speed, and buttons for views and lamps; shown on touch screens.

import type { Actions } from '../actions'
import type { Driver } from '../driving/driver'
import type { Lights } from '../messages'
import { Headlights, Indicators } from '../messages'
import type { Store } from '../store'
import type { DriveInput } from '../worker/port'
import { h, icon, setText } from './element'
import { speedText } from './hud_rows'
import { CAMERA, HAZARD, HIGH_BEAM, LEFT_INDICATOR, LOW_BEAM, RIGHT_INDICATOR, VEHICLE } from './icons'

/** `record` is the button that records; the toolbar of a small screen has no place for it. */
export function touch(driver: Driver, store: Store, actions: Actions, record: HTMLElement): HTMLElement {
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
    pad(driver, store, 'steering', 'Steering'),
    h(
      'div',
      { class: 'touch-buttons' },
      h(
        'div',
        { class: 'touch-views' },
        speed(store),
        press('touch-camera', 'Next camera', CAMERA, () => actions.nextCamera()),
        nextVehicle(store, actions),
        record,
      ),
      h(
        'div',
        { class: 'touch-lamps' },
        beam('Low beam', LOW_BEAM, Headlights.LOW),
        beam('High beam', HIGH_BEAM, Headlights.HIGH),
        side('Left indicator', LEFT_INDICATOR, Indicators.LEFT),
        side('Hazard indicators', HAZARD, Indicators.HAZARD),
        side('Right indicator', RIGHT_INDICATOR, Indicators.RIGHT),
      ),
    ),
    pad(driver, store, 'throttle', 'Throttle'),
  )
}

/** The speed of the selected vehicle. */
function speed(store: Store): HTMLElement {
  const text = h('span', { class: 'touch-speed', testid: 'touch-speed' })
  store.frame.watch((frame) => {
    const vehicle = frame?.vehicles[store.vehicle.value]
    setText(text, vehicle ? speedText(vehicle) : '')
  })
  return text
}

function press(testid: string, label: string, path: string, onclick: () => void): HTMLButtonElement {
  return h('button', { testid, 'aria-label': label, title: label, onclick }, icon(path))
}

/** The button to the next vehicle, if there are several. */
function nextVehicle(store: Store, actions: Actions): HTMLElement {
  const button = press('touch-vehicle', 'Next vehicle', VEHICLE, () => actions.nextVehicle())
  store.scene.watch((scene) => (button.hidden = Object.keys(scene?.vehicles ?? {}).length < 2))
  return button
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

/** A pad with a knob that follows the finger along one axis and returns to the centre on release. It drives or flies. */
function pad(driver: Driver, store: Store, axis: keyof DriveInput, label: string): HTMLElement {
  const knob = h('i', { class: 'knob' })
  const element = h('div', { class: `pad ${axis}`, testid: `pad-${axis}`, role: 'group', 'aria-label': label }, knob)

  /** `value` in [-1, 1]; up and left are positive. */
  function set(value: number): void {
    if (store.isFlying) store.flyInput[axis === 'throttle' ? 'ahead' : 'left'] = value
    else driver.touch[axis] = value
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
  element.addEventListener('contextmenu', (event) => {
    event.preventDefault() // a finger that rests on the pad is no request for a menu
    event.stopPropagation()
  })
  element.addEventListener('pointermove', follow)
  element.addEventListener('lostpointercapture', () => set(0))
  return element
}
