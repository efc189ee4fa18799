// Telltales: the state of the lamps of the vehicle as icons.
import type { Lights, VehicleFrame } from '../messages'
import { Headlights } from '../messages'
import { h, icon } from './element'
import { HIGH_BEAM, LEFT_INDICATOR, LOW_BEAM, RIGHT_INDICATOR } from './icons'

export interface Telltales {
  element: HTMLElement
  refresh: (vehicle: VehicleFrame | null) => void
}

type Lit = 'off' | 'dim' | 'on'

interface Telltale {
  id: string
  label: string
  path: string
  lit: (lights: Lights) => Lit
}

const onIf = (is: boolean): Lit => (is ? 'on' : 'off')

const TELLTALES: readonly Telltale[] = [
  {
    id: 'left',
    label: 'Left indicator',
    path: LEFT_INDICATOR,
    lit: (lights) => onIf(lights.left_indicator),
  },
  {
    id: 'low',
    label: 'Low beam',
    path: LOW_BEAM,
    lit: (lights) => onIf(lights.headlights === Headlights.LOW),
  },
  {
    id: 'high',
    label: 'High beam',
    path: HIGH_BEAM,
    lit: (lights) => onIf(lights.headlights === Headlights.HIGH),
  },
  {
    id: 'tail',
    label: 'Tail lights',
    path: 'M12 8a4 4 0 1 1 0 8a4 4 0 1 1 0-8M5 6.5a9.5 9.5 0 0 0 0 11M19 6.5a9.5 9.5 0 0 1 0 11',
    lit: (lights) => (['off', 'dim', 'on'] as const)[lights.tail_lights] ?? 'off',
  },
  {
    id: 'reverse',
    label: 'Reverse lights',
    path: 'M9 19V5h4.5a3.7 3.7 0 0 1 0 7.4H9M13 12.4l4 6.6',
    lit: (lights) => onIf(lights.reverse_lights),
  },
  {
    id: 'right',
    label: 'Right indicator',
    path: RIGHT_INDICATOR,
    lit: (lights) => onIf(lights.right_indicator),
  },
]

export function telltales(): Telltales {
  const element = h('div', { class: 'lamps', testid: 'hud-lamps', role: 'group', 'aria-label': 'Lamps' })
  const all = TELLTALES.map(({ id, label, path, lit }) => {
    const lamp = h('span', { class: 'lamp', testid: `hud-lamp-${id}`, title: label, role: 'img' }, icon(path))
    lamp.dataset.lamp = id
    element.append(lamp)
    return { lamp, label, lit }
  })
  return {
    element,
    refresh(vehicle) {
      for (const { lamp, label, lit } of all) {
        const state = vehicle ? lit(vehicle.lights) : 'off'
        if (lamp.dataset.lit === state) continue
        lamp.dataset.lit = state
        lamp.setAttribute('aria-label', `${label}: ${state}`)
      }
    },
  }
}
