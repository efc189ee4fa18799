// Traffic lights of the map: what each one shows and for how long; a state of the user replaces its program.

import type { Actions } from '../actions'
import type { Frame, TrafficLightFrame } from '../messages'
import { TrafficLightState } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { choice, labelled, section, setOptions } from './fields'

/** By the names of `TrafficLightState`: an object lists numbers first. */
const OPTIONS = { '': 'Program', RED: 'Red', YELLOW: 'Yellow', GREEN: 'Green', OFF: 'Off' }
type Option = keyof typeof OPTIONS

export function trafficLights(store: Store, actions: Actions): HTMLElement {
  const rows = h('div', {})
  const element = section('Traffic lights', rows)
  const shown = new Map<string, { select: HTMLSelectElement; text: HTMLElement }>()
  element.classList.add('live') // it has no effect in a replay, which hides it

  function show(frame: Frame | null): void {
    const lights = frame?.traffic_lights ?? {}
    element.hidden = Object.keys(lights).length === 0
    if (Object.keys(lights).join('\n') !== [...shown.keys()].join('\n')) make(Object.keys(lights))
    for (const [name, light] of Object.entries(lights)) {
      const row = shown.get(name)
      if (!row) continue
      setText(row.text, lightText(light))
      if (document.activeElement !== row.select)
        row.select.value = light.mode === 'set' ? TrafficLightState[light.state] : ''
    }
  }

  function make(names: readonly string[]): void {
    shown.clear()
    for (const name of names) {
      const select = choice(`light-${name}`, (value) => {
        void actions.request({
          type: 'SetTrafficLight',
          light: name,
          state: value === '' ? null : TrafficLightState[value as Exclude<Option, ''>],
        })
      })
      setOptions(select, OPTIONS)
      select.value = ''
      shown.set(name, { select, text: h('span', { class: 'state', testid: `light-${name}-state` }) })
    }
    rows.replaceChildren(
      ...[...shown].map(([name, { select, text }]) =>
        labelled(name.replaceAll('_', ' '), h('span', { class: 'slider' }, select, text)),
      ),
    )
  }

  store.frame.watch(show)
  return element
}

/** For example 'Green, 3 s'. */
export function lightText({ state, time_to_change, mode }: TrafficLightFrame): string {
  const name = mode === 'flashing' ? 'Flashing' : OPTIONS[TrafficLightState[state] as Option]
  return time_to_change === null || mode === 'flashing' ? name : `${name}, ${Math.ceil(time_to_change)} s`
}
