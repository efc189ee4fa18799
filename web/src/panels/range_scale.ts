// The legend of colours by range: a bar with the colour map, from 0 m to a round distance.
import type { Observable } from '../observable'
import { TURBO_GRADIENT } from '../scene/turbo'
import { h, setText } from './element'

/** `farthest` [m]: where the colours end; 0: not known. */
export function rangeScale(title: string, farthest: Observable<number>): HTMLElement {
  const end = h('span')
  const bar = h('i', { style: `background: ${TURBO_GRADIENT}` })
  const element = h('div', { class: 'range-scale', role: 'img', testid: 'range-scale' }, h('span', {}, '0'), bar, end)
  farthest.watch((metres) => {
    setText(end, metres ? `${metres} m` : '–')
    element.setAttribute('aria-label', metres ? `${title}: dark blue is 0 m, dark red is ${metres} m` : title)
  })
  return element
}
