// What a scenario is called where its title is shown.

/** The name of a scenario without the folder and the ending of its file. */
export function stem(name: string): string {
  return name.replace(/^.*[/\\]|\.ya?ml$/g, '')
}

/** The name of a file for a title: 'My track' becomes my_track; empty if the title has no Latin letters or digits. */
export function fileName(title: string): string {
  return title
    .toLowerCase()
    .replace(/[^a-z0-9-]+/g, '_')
    .replace(/^_+|_+$/g, '')
}

/** The title of a scenario, or the name of its file if it has none. */
export function scenarioTitle(name: string, title: string): string {
  return title || stem(name)
}
