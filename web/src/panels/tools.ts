// The tools section of the menu: full screen, screenshot, measuring, log, small map, trails.
import '../tools.css'
import type { Actions } from '../actions'
import type { Observable } from '../observable'
import type { Store } from '../store'
import { h } from './element'
import { labelled, section } from './fields'

export function tools(store: Store, actions: Actions): HTMLElement {
  const fullScreen = h(
    'button',
    { testid: 'full-screen', title: 'Key {KeyF}', onclick: toggleFullScreen },
    'Full screen',
  )
  fullScreen.hidden = !document.fullscreenEnabled
  document.addEventListener('fullscreenchange', () =>
    fullScreen.setAttribute('aria-pressed', String(document.fullscreenElement !== null)),
  )
  const screenshot = { testid: 'screenshot', title: 'Download the view as a PNG file (key {KeyI})' }
  return section(
    'Tools',
    h(
      'div',
      { class: 'tools' },
      fullScreen,
      h('button', { ...screenshot, onclick: () => void actions.downloadView() }, 'Screenshot'),
      toggle('measure-button', 'Measure', 'Distance between two points on the ground (key {KeyX})', store.isMeasuring),
      toggle('menu-edit', 'Edit', 'Edit the scenario (key {KeyJ})', store.isEditing), // a narrow bar has no place for it
      toggle('log-button', 'Log', 'All notices with their times (key {KeyO})', store.isLogOpen),
    ),
    labelled('Small map', toggleSwitch('minimap-switch', 'Key {KeyQ}', store.isMapOpen)),
    labelled('Describe the scene', toggleSwitch('describe-switch', DESCRIBE, store.isDescribed)),
    labelled('Driven lines', toggleSwitch('trails-switch', 'Key {KeyT}', store.areTrailsShown)),
    labelled('Names of vehicles', toggleSwitch('labels-switch', LABELS, store.areLabelsShown)),
    labelled('Collision shapes', toggleSwitch('shapes-switch', SHAPES, store.areShapesShown)),
    labelled('Contact forces', toggleSwitch('forces-switch', FORCES, store.areForcesShown)),
    labelled('Axes', toggleSwitch('axes-switch', AXES, store.areAxesShown)),
    labelled('Drawings of programs', toggleSwitch('drawings-switch', DRAWINGS, store.areDrawingsShown)),
  )
}

const LABELS = 'Names above the vehicles, if there are several; those of the traffic only below the pointer'
const SHAPES = 'What vehicles and movable boxes collide with, and fixed shapes near the vehicle (key 1)'
const FORCES = 'Arrows for the forces of the ground on the wheels, and of collisions on the body (key 2)'
const AXES = 'Axes of the vehicles and of their sensors: x red, y green, z blue (key 3)'
const DRAWINGS = 'Points, lines and texts that programs draw into the scene'
const DESCRIBE = 'Each second a line of text for screen readers: place, speed and nearest obstacle (key {KeyY})'

/** Enters or leaves full screen. */
export function toggleFullScreen(): void {
  if (document.fullscreenElement) void document.exitFullscreen()
  else void document.documentElement.requestFullscreen?.()
}

function toggle(testid: string, label: string, title: string, is: Observable<boolean>): HTMLElement {
  const button = h('button', { testid, title, onclick: () => (is.value = !is.value) }, label)
  is.watch((value) => button.setAttribute('aria-pressed', String(value)))
  return button
}

/** A switch for an Observable. */
function toggleSwitch(testid: string, title: string, is: Observable<boolean>): HTMLElement {
  const field = h('input', { type: 'checkbox', testid, title, role: 'switch' })
  field.addEventListener('change', () => (is.value = field.checked))
  is.watch((value) => (field.checked = value))
  return field
}
