// The files of the user: opened and saved in the folder of the simulator, opened from texts, exported to map_server.
import { type Actions, sentence } from '../actions'
import { saveFile, saveText } from '../editing/save_text'
import type { SaveFile } from '../messages'
import { stem } from '../scenario_title'
import type { Store } from '../store'

export class UserFiles {
  constructor(
    private readonly store: Store,
    private readonly actions: Actions,
  ) {
    store.link.watch((link) => {
      if (link === 'open') void this.refresh()
    })
    store.isBuilding.watch((isBuilding) => {
      if (isBuilding) void this.refresh()
    })
  }

  /** Name of the folder; empty: there is none. */
  get folder(): string {
    return this.store.welcome.value?.folder ?? ''
  }

  /** Reads the list of the folder. */
  async refresh(): Promise<void> {
    if (!this.folder) return
    const { response, errors } = await this.actions.attempt({ type: 'ListFiles' })
    if (response) this.store.files.value = response.files
    for (const error of errors) this.store.error.value = error
  }

  /** Opens a file of the folder, or the text of any file. */
  async open(name: string, text = ''): Promise<boolean> {
    const warnings = await this.actions.textOf({ type: 'OpenFile', name: name.slice(-100), text })
    if (warnings) this.store.warning.value = sentence(warnings)
    return warnings !== null
  }

  /** Whether the folder has a file of that name. */
  async has(name: string): Promise<boolean> {
    await this.refresh()
    return `${stem(name)}.yaml`.toLowerCase() in lowered(this.store.files.value ?? {})
  }

  /** Saves the map or the scenario in the folder; returns whether it was saved. */
  async save(file: Omit<SaveFile, 'type'>): Promise<boolean> {
    const saved = await this.actions.textOf({ type: 'SaveFile', ...file, name: stem(file.name) })
    if (saved === null) return false
    this.store.hasUnsavedEdits.value = false
    this.store.notice.value = `Saved ${saved} in the folder ${this.folder}.`
    await this.refresh()
    return true
  }

  /** Downloads the map for map_server: a picture and its YAML file. */
  async exportMap(name: string, resolution: number): Promise<boolean> {
    const plain =
      stem(name)
        .replace(/[^\w-]+/g, '_')
        .slice(0, 100) || 'map'
    const { response, errors } = await this.actions.attempt({ type: 'ExportMap', name: plain, resolution })
    for (const error of errors) this.store.error.value = error
    if (!response) return false
    saveFile(`${plain}.png`, response.picture.slice(), 'image/png')
    saveText(`${plain}.yaml`, response.text, 'application/yaml')
    return true
  }
}

function lowered<T>(files: Record<string, T>): Record<string, T> {
  return Object.fromEntries(Object.entries(files).map(([name, file]) => [name.toLowerCase(), file]))
}
