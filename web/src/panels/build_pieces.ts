// The palette of Build mode: pictures of all pieces in three tabs, with a search.
import type { Builder } from '../building/builder'
import { words } from '../building/part_names'
import type { MapScene, ModuleScene } from '../messages'
import { Observable } from '../observable'
import { sceneUrl } from '../scene/assets'
import type { SceneView } from '../scene/view'
import type { Store } from '../store'
import { h } from './element'
import { section, segments } from './fields'

type Tab = 'roads' | 'signs' | 'things'

const TABS: readonly (readonly [Tab, string])[] = [
  ['roads', 'Roads'],
  ['signs', 'Signs and lights'],
  ['things', 'Things'],
]
/** Walls and blocks from above, as SVG elements on a square of 100: they have no drawing of the simulator. */
const DRAWN = {
  wall: '<path d="M12 78 H60 V22 H88" fill="none" stroke="#4a4e52" stroke-width="15"/><path d="M12 78 H60 V22 H88" fill="none" stroke="#a9abaa" stroke-width="9"/>',
  block:
    '<path d="M24 34 H88 V90 H24 Z" fill="#00000038"/><path d="M14 20 H78 V78 H14 Z" fill="#ead9b8" stroke="#4a4e52" stroke-width="3"/><path d="M22 28 H70 V70 H22 Z" fill="#77746f"/><path d="M50 36 H62 V46 H50 Z" fill="#a5a29c"/>',
}

/** `close` is called when a piece was chosen. */
export function pieces(store: Store, builder: Builder, view: () => SceneView | null, close: () => void): HTMLElement {
  const middle = (): readonly [number, number] => view()?.groundPoint(0.5 * innerWidth, 0.5 * innerHeight) ?? [0, 0]
  const tab = new Observable<Tab>('roads')
  const tabs = segments('build-tabs', 'Kinds of pieces', TABS, (name) => {
    search.value = ''
    tab.value = name
  })
  const search = h('input', {
    ...{ type: 'search', testid: 'build-search', placeholder: 'Search', 'aria-label': 'Search the pieces' },
    oninput: () => filter(),
  })
  const grid = h('div', { class: 'pieces', testid: 'build-pieces' })
  const nothing = h('p', { class: 'edit-hint', hidden: true }, 'No piece has this name.')
  const hint = h('p', { class: 'edit-hint' }, 'Click an open end of a road, or take a piece. {KeyN}: next open end.')
  let shown: MapScene | null = null

  function card(
    id: string,
    kind: Tab,
    title: string,
    image: string,
    use: (isByKey: boolean) => void,
  ): HTMLButtonElement {
    const onclick = ({ detail }: MouseEvent): void => {
      button.blur() // Enter then sets the piece
      use(detail === 0)
      close()
    }
    const picture = h('img', { src: image, alt: '', loading: 'lazy' })
    const button = h('button', { class: 'piece', testid: `piece-${id}`, title, onclick }, picture, h('span', {}, title))
    button.dataset.piece = id
    button.dataset.tab = kind
    return button
  }

  function fill(scene: MapScene): void {
    const modules = Object.entries(scene.modules).map(([name, module]) =>
      card(name, tabOf(module), module.title, sceneUrl(module.image).href, (isByKey) => {
        const hand = builder.hand.value
        if (hand?.kind === 'module' && hand.target && !hand.moved) builder.change(name)
        else if (isByKey) builder.takeAtEnd(name, middle())
        else builder.take(name, middle())
      }),
    )
    const walls = (['wall', 'block'] as const).map((kind) =>
      card(kind, 'things', words(kind), drawn(DRAWN[kind]), () => builder.start(kind)),
    )
    const signs = scene.props.map((kind) =>
      card(`sign-${kind}`, 'signs', words(kind), faceOf(scene, kind), () => builder.takeProp(kind, middle())),
    )
    grid.replaceChildren(...modules, ...walls, ...signs)
    filter()
  }

  /** Shows the pieces that fit: to the search in all tabs, to the open end, or else to the tab. */
  function filter(): void {
    const wanted = search.value.trim().toLowerCase()
    const hand = builder.hand.value
    const fitting = hand?.kind === 'module' && hand.target ? new Set(builder.offered) : null
    const held = hand?.kind === 'module' ? hand.part.module : hand?.kind === 'part' ? '' : (hand?.kind ?? '')
    const buttons = [...grid.querySelectorAll<HTMLElement>('.piece')]
    for (const button of buttons) {
      const id = button.dataset.piece ?? ''
      const isNamed = (button.textContent ?? '').toLowerCase().includes(wanted)
      const isOfTab = wanted !== '' || button.dataset.tab === (fitting ? 'roads' : tab.value)
      button.hidden = !isNamed || !isOfTab || (fitting !== null && !fitting.has(id))
      button.setAttribute('aria-pressed', String(id === held))
    }
    nothing.hidden = buttons.some((button) => !button.hidden)
    tabs.show(fitting ? 'roads' : wanted ? '' : tab.value)
  }

  store.scene.watch((scene) => {
    const map = scene?.map_scene
    if (!map || (shown && isSame(map, shown))) return
    shown = map
    fill(map)
  })
  builder.hand.watch(filter)
  tab.watch(filter)
  const element = section('Pieces', tabs.element, search, grid, nothing, hint)
  element.classList.add('palette')
  return element
}

/** The picture of a sign or traffic light. */
export function faceOf(scene: MapScene, kind: string): string {
  const face = scene.faces?.[kind]
  return face ? sceneUrl(face).href : drawn('<circle cx="50" cy="50" r="40" fill="#566473"/>')
}

/** The picture of a wall or a block. */
export function solidPicture(kind: keyof typeof DRAWN): string {
  return drawn(DRAWN[kind])
}

function tabOf({ type }: ModuleScene): Tab {
  return type === 'terrain' || type === 'obstruction' ? 'things' : 'roads'
}

function isSame(a: MapScene, b: MapScene): boolean {
  return JSON.stringify([a.modules, a.props, a.faces]) === JSON.stringify([b.modules, b.props, b.faces])
}

function drawn(svg: string): string {
  return `data:image/svg+xml,${encodeURIComponent(`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">${svg}</svg>`)}`
}
