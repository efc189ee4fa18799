// The dialog that saves the edited scenario: its title and the name of its file.
import type { Builder } from '../building/builder'
import { linkWith } from '../building/map_files'
import type { UserFiles } from '../building/user_files'
import type { Editor } from '../editing/editor'
import { fileName, scenarioTitle, stem } from '../scenario_title'
import type { Store } from '../store'
import { copyButton } from './clipboard'
import { h } from './element'
import { choice, setOptions } from './fields'
import { ask, type Choice } from './question'

/** Added to the title of the scenario that was edited. */
const EDITED = ' (edited)'

/** Asks for title and name, then downloads the file or saves it in the user's folder; returns whether it was saved. */
export async function saveScenario(store: Store, editor: Editor, files: UserFiles): Promise<boolean> {
  const scene = store.scene.value
  const before = scene ? scenarioTitle(scene.scenario, scene.title) : ''
  const value = before.endsWith(EDITED) ? before : `${before}${EDITED}`
  const { fields, title, name } = named(value, editor.fileName)
  const answer = await ask('save-dialog', 'Save as scenario', fields, [...inFolder(files), ['save', 'Save', true]])
  const named_ = [title.value.trim(), name.value.trim()] as const
  if (answer === 'folder') return saveInFolder(files, 'scenario', ...named_)
  return answer === 'save' && editor.save(...named_)
}

/** The choice to save in the user's folder, if there is one. */
function inFolder({ folder }: UserFiles): Choice[] {
  return folder ? [['folder', `Save in the folder ${folder}`]] : []
}

/** Saves in the folder; asks before a file there is replaced. */
async function saveInFolder(files: UserFiles, kind: 'map' | 'scenario', title: string, name: string): Promise<boolean> {
  const replaces = await files.has(name)
  const text = `The folder ${files.folder} has a file ${stem(name)}.yaml already.`
  const question = [h('p', {}, text)]
  if (replaces && (await ask('replace-dialog', 'Replace the file?', question, [['replace', 'Replace']])) !== 'replace')
    return false
  return files.save({ kind, title, name, replaces })
}

/** Asks for the size of a pixel, then downloads picture and YAML file. */
async function exportMap(store: Store, files: UserFiles, name: string): Promise<boolean> {
  const isTrack = Boolean(store.scene.value?.track_scene)
  const edge = h('input', {
    ...{ type: 'number', testid: 'export-resolution', min: 0.001, max: 1, step: 'any', required: true },
    value: isTrack ? 0.05 : 0.02,
  })
  const note = h('p', {}, 'A picture (PNG) and its YAML file for map_server of ROS: white is free, black is occupied.')
  const field = h('label', { class: 'named' }, h('span', {}, 'Edge of a pixel [m]'), edge)
  const answer = await ask('export-dialog', 'Export the map', [note, field], [['export', 'Export', true]])
  return answer === 'export' && files.exportMap(name, Number(edge.value))
}

/** Asks whether unsaved edits may be lost. */
export async function mayDiscard(what: string, save: () => Promise<boolean>): Promise<boolean> {
  // no title: that of the scenario is wrong if its map was replaced by another one
  const text = `There are edits that are not saved. ${what} discards them.`
  const choices = [
    ['discard', 'Discard the edits'],
    ['save', 'Save first…', true],
  ] as const
  const answer = await ask('discard-dialog', 'Unsaved edits', [h('p', {}, text)], choices)
  return answer === 'discard' || (answer === 'save' && save())
}

/** Asks whether the traffic, which forbids a map, may be removed. */
export async function mayRemoveTraffic(why: string): Promise<boolean> {
  const text = [why, 'Without traffic you can build any map. Undo brings the traffic back.']
  const content = text.map((line) => h('p', {}, line))
  const choices = [['remove', 'Build without traffic', true]] as const
  return (await ask('traffic-dialog', 'The traffic needs other roads', content, choices)) === 'remove'
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
  let isCopied = false
  const button = copyButton('link-copy', shown, { isPrimary: true, done: (now) => (isCopied = now) })
  await ask('link-dialog', 'Link with the map', [note, shown, h('p', {}, button)], [])
  return isCopied
}

/** Asks for title and name, then downloads the map, or its scenario; returns whether it was saved. */
export async function saveMap(
  store: Store,
  builder: Builder,
  files: UserFiles,
  saveWithVehicles: () => Promise<boolean>,
): Promise<boolean> {
  const { fields, title, name } = named('My map', 'my_map')
  let given = name.value
  title.addEventListener('input', () => {
    // the name follows the title until the user changes it
    if (name.value === given) name.value = given = fileName(title.value) || given
  })
  const problems = builder.problemCount
  const left = problems === 1 ? '1 problem is left.' : `${problems} problems are left.`
  const note = problems > 0 && h('p', {}, `${left} The file says that the map is a draft; it can be run.`)
  const kind = choice('save-kind', () => {})
  setOptions(kind, {
    map: 'The map, as a file',
    ...(files.folder && { folder: `The map, in the folder ${files.folder}` }),
    scenario: 'The scenario with its map and vehicles',
    export: 'A picture for ROS (map_server)',
    link: 'A link that contains the map',
  })
  const content = [h('label', { class: 'named' }, h('span', {}, 'What to save'), kind), ...fields, note]
  const answer = await ask('save-map', 'Save the map', content, [['save', 'Save', true]])
  if (answer === '') return false
  if (kind.value === 'scenario') return saveWithVehicles()
  if (kind.value === 'link') {
    const text = await builder.text(title.value.trim())
    return text !== null && showLink(text)
  }
  const named_ = [title.value.trim(), name.value.trim()] as const
  if (kind.value === 'folder') return saveInFolder(files, 'map', ...named_)
  if (kind.value === 'export') return exportMap(store, files, named_[1])
  return builder.save(...named_)
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
