// Settings of the sensors of the selected vehicle: on or off, rate, noise. All clients share them.

import type { Editor } from '../editing/editor'
import type { SensorScene } from '../messages'
import type { Store } from '../store'
import { h } from './element'
import { choice, section, setOptions } from './fields'

const NOISES: Record<string, string> = {
  ideal: 'None',
  file: 'File',
  realistic: 'Data sheet',
  strong: 'Strong',
}
const NAMES: Record<string, string> = {
  encoders: 'Encoders',
  ips: 'IPS',
  imu: 'IMU',
  lidar: 'LIDAR',
  range: 'Range',
}

export function sensors(store: Store, editor: Editor): HTMLElement {
  const rows = h('div', { class: 'sensors', testid: 'sensors' })
  const element = section('Sensors', rows)
  const title = element.querySelector('h2')
  let shown = ''

  function show(): void {
    const vehicles = store.scene.value?.vehicles ?? {}
    const vehicle = store.selection.value in vehicles ? store.selection.value : store.vehicle.value
    const its = vehicles[vehicle]?.sensors ?? {}
    const key = JSON.stringify([vehicle, its])
    if (key === shown) return
    shown = key
    const focused = document.activeElement?.getAttribute('data-testid')
    if (title) title.textContent = `Sensors of ${vehicle}`
    const head = ['Sensor', 'On', 'Rate [Hz]', 'Noise'].map((text) => h('span', { class: 'head' }, text))
    const all = Object.entries(its).flatMap(([name, sensor]) => row(vehicle, name, sensor))
    rows.replaceChildren(...head, ...all)
    if (focused) rows.querySelector<HTMLElement>(`[data-testid="${focused}"]`)?.focus()
  }

  function row(vehicle: string, name: string, sensor: SensorScene): HTMLElement[] {
    const short = NAMES[name] ?? name.charAt(0).toUpperCase() + name.slice(1)
    const label = sensor.is_camera ? `${name} camera` : short
    const set = async (): Promise<void> => {
      const settings = { is_on: on.checked, rate: Number(rate.value) || null, noise: noise.value as never }
      if (await editor.setSensor({ vehicle, sensor: name, ...settings })) return
      shown = '' // show the values that are valid
      show()
    }
    const on = h('input', {
      ...{ type: 'checkbox', role: 'switch', testid: `${name}-on`, 'aria-label': `${label} on`, onchange: set },
      checked: sensor.is_on,
    })
    const rate = h('input', {
      ...{ type: 'number', testid: `${name}-rate`, min: 0.1, step: 'any', placeholder: 'tick', onchange: set },
      ...{ value: sensor.rate, 'aria-label': `Rate of ${label} [Hz]; empty: as in the vehicle's file` },
    })
    const noise = choice(`${name}-noise`, () => void set(), {
      'aria-label': `Noise of ${label}`,
      title: "None; as in the vehicle's file; as in the data sheet; several times that",
    })
    setOptions(noise, Object.fromEntries(sensor.noises.map((one) => [one, NOISES[one] ?? one])))
    noise.value = sensor.noise
    return [h('span', { title: label }, short), h('label', { class: 'switch' }, on), rate, noise]
  }

  for (const observable of [store.scene, store.selection, store.vehicle]) observable.watch(show)
  return element
}
