// The dialog that saves the edited scenario: its title and the name of its file.
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
  const limits = { required: true, maxlength: 200, autocomplete: 'off' }
  const value = before.endsWith(EDITED) ? before : `${before}${EDITED}`
  const title = h('input', { type: 'text', testid: 'save-title', value, ...limits })
  const name = h('input', { type: 'text', testid: 'save-name', value: editor.fileName, ...limits })
  const fields = [
    h('label', { class: 'named' }, h('span', {}, 'Title'), title),
    h('label', { class: 'named' }, h('span', {}, 'Name of the file, without .yaml'), name),
  ]
  const choice = await ask('save-dialog', 'Save as scenario', fields, [['save', 'Save', true]])
  return choice === 'save' && editor.save(title.value.trim(), name.value.trim())
}
