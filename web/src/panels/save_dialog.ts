// The dialog that saves the edited scenario: its title and the name of its file.
import type { Builder } from '../building/builder'
import { linkWith } from '../building/map_files'
import type { Editor } from '../editing/editor'
import { scenarioTitle } from '../scenario_title'
import type { Store } from '../store'
import { h } from './element'
import { ask } from './question'

/** Added to the title of the scenario that was edited. */
const EDITED = ' (edited)'

/** Asks for title and name, then downloads the file; returns whether it was saved. */
export async function saveScenario(store: Store, editor: Editor): Promise<boolean> {
  const scene = store.scene.value
  const before = scene ? scenarioTitle(scene.scenario, scene.title) : ''
  const value = before.endsWith(EDITED) ? before : `${before}${EDITED}`
  const { fields, title, name } = named(value, editor.fileName)
  const choice = await ask('save-dialog', 'Save as scenario', fields, [['save', 'Save', true]])
  return choice === 'save' && editor.save(title.value.trim(), name.value.trim())
}

/** Asks whether unsaved edits may be lost. */
export async function mayDiscard(store: Store, what: string, save: () => Promise<boolean>): Promise<boolean> {
  const scene = store.scene.value
  const title = scene ? scenarioTitle(scene.scenario, scene.title) : ''
  const text = `The edits of “${title}” are not saved. ${what} discards them.`
  const choices = [
    ['discard', 'Discard the edits'],
    ['save', 'Save first…', true],
  ] as const
  const answer = await ask('discard-dialog', 'Unsaved edits', [h('p', {}, text)], choices)
  return answer === 'discard' || (answer === 'save' && save())
}

/** Shows a link that contains the map. */
async function showLink(text: string): Promise<boolean> {
  const link = await linkWith(text)
  if (link === null) {
    await ask('link-dialog', 'Link', [h('p', {}, 'The map is too large for a link. Save it as a file.')], [])
    return false
  }
  const shown = h('p', { class: 'link', testid: 'map-link' }, link)
  const note = h(
    'p',
    {},
    'Whoever opens the link with a running simulator gets the map. Replace the address before # by theirs.',
  )
  if ((await ask('link-dialog', 'Link with the map', [note, shown], [['copy', 'Copy', true]])) !== 'copy') return false
  await navigator.clipboard?.writeText(link).catch(() => undefined)
  return true
}

/** Asks for title and name, then downloads the map, or its scenario; returns whether it was saved. */
export async function saveMap(builder: Builder, saveWithVehicles: () => Promise<boolean>): Promise<boolean> {
  const { fields, title, name } = named('My map', 'my_map')
  const problems = builder.problemCount
  const note =
    problems > 0 && h('p', {}, `${problems} problems are left. The file says that the map is a draft; it can be run.`)
  const choices = [
    ['link', 'Link'],
    ['scenario', 'Save as scenario'],
    ['map', 'Save the map', true],
  ] as const
  const choice = await ask('save-map', 'Save the map', [...fields, note], choices)
  if (choice === 'scenario') return saveWithVehicles()
  if (choice === 'link') {
    const text = await builder.text(title.value.trim())
    return text !== null && showLink(text)
  }
  return choice === 'map' && builder.save(title.value.trim(), name.value.trim())
}

/** Fields for the title and the name of a file. */
function named(givenTitle: string, givenName: string) {
  const limits = { required: true, maxlength: 200, autocomplete: 'off' }
  const title = h('input', { type: 'text', testid: 'save-title', value: givenTitle, ...limits })
  const name = h('input', { type: 'text', testid: 'save-name', value: givenName, ...limits })
  const fields = [
    h('label', { class: 'named' }, h('span', {}, 'Title'), title),
    h('label', { class: 'named' }, h('span', {}, 'Name of the file, without .yaml'), name),
  ]
  return { fields, title, name }
}
