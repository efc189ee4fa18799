// The scenarios that can be chosen, and the one that is being loaded.
import { sentence } from './actions'
import type { Connection } from './connection'
import { Observable } from './observable'
import { scenarioTitle } from './scenario_title'
import type { Store } from './store'

/** Begins the names of scenarios of the user's folder. */
const OWN = 'folder/'

export class Scenarios {
  /** Name of the scenario that is being loaded; empty: none. */
  readonly loading = new Observable('')
  /** Why the scenario that was chosen last could not be loaded. */
  readonly error = new Observable('')

  /** `mayDiscard` asks before edits are lost that are in no file. */
  constructor(
    private readonly store: Store,
    private readonly connection: Connection,
    private readonly mayDiscard: () => Promise<boolean>,
  ) {}

  /** Titles by name: those of the simulator, the present one, and those of the user's folder. */
  get titles(): Record<string, string> {
    const { scene, welcome, files } = this.store
    const present = scene.value && { [scene.value.scenario]: scene.value.title }
    const titles = Object.entries({ ...present, ...welcome.value?.scenarios })
    const own = Object.entries(files.value ?? {})
      .filter(([name, { kind }]) => kind === 'scenario' && !scene.value?.scenario.endsWith(`/${name}`))
      .map(([name, { title }]) => [OWN + name, `${scenarioTitle(name, title)} (${welcome.value?.folder})`])
    return Object.fromEntries([...titles.map(([name, title]) => [name, scenarioTitle(name, title)]), ...own])
  }

  /** Loads a scenario; asks first if the present one has edits that are in no file. Returns whether it was loaded. */
  async choose(name: string): Promise<boolean> {
    if (this.store.hasUnsavedEdits.value && !(await this.mayDiscard())) {
      this.loading.value = '' // who shows the choice shows the present scenario again
      return false
    }
    this.error.value = ''
    this.loading.value = name
    const isOwn = name.startsWith(OWN)
    try {
      await this.connection.request(
        isOwn ? { type: 'OpenFile', name: name.slice(OWN.length) } : { type: 'LoadScenario', name },
      )
      return true
    } catch (reason) {
      this.error.value = sentence(reason)
      return false
    } finally {
      this.loading.value = ''
    }
  }
}
