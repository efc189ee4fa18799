// Map and track files in the page: a file is dropped on it, a link contains the map, and edits are not lost unasked.
import { Observable } from '../observable'
import type { Propose } from '../panels/link_changes'
import type { Store } from '../store'
import type { Builder } from './builder'
import { MAX_FILE, through } from './bytes'
import { type Picture, type PictureOptions, readPicture, type Sheet, sheetOf } from './picture'
import type { UserFiles } from './user_files'

/** Longest value in a link; browsers accept longer ones, but programs that send links cut them. */
export const MAX_LINK = 30_000
/** Name of the map in the fragment of a link. */
const KEY = 'own_map'

/** The text, compressed for the address of a page, after its length in bytes. */
export async function packed(text: string): Promise<string> {
  const plain = new TextEncoder().encode(text)
  const bytes = await through(plain, new CompressionStream('deflate'), Number.POSITIVE_INFINITY)
  const value = btoa(String.fromCharCode(...bytes))
  return `${plain.length}.${value.replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '')}`
}

/** The text of a link; null if it was cut or changed, or would be too long. */
export async function unpacked(link: string): Promise<string | null> {
  const [length, value = ''] = link.split('.')
  try {
    const bytes = Uint8Array.from(atob(value.replaceAll('-', '+').replaceAll('_', '/')), (one) => one.charCodeAt(0))
    const plain = await through(bytes, new DecompressionStream('deflate'), MAX_FILE)
    return plain.length === Number(length) ? new TextDecoder('utf-8', { fatal: true }).decode(plain) : null
  } catch {
    return null
  }
}

/** The address of the page with the map in it; null if it would be too long. */
export async function linkWith(text: string): Promise<string | null> {
  const value = await packed(text)
  return value.length > MAX_LINK ? null : `${location.origin}${location.pathname}#${KEY}=${value}`
}

/** Asks how a picture becomes a track, until `use` has no problem any more; the user may add its sheet meanwhile. */
export type AskPicture = (
  picture: Picture,
  sheet: Observable<Sheet | null>,
  use: (options: PictureOptions) => Promise<readonly string[]>,
) => Promise<boolean>

/** Opens files that are dropped on the page, and the map of its link if the user agrees; asks before unsaved edits are lost.
 *
 * Returns a function that opens files.
 */
export function openMapFiles(
  store: Store,
  builder: Builder,
  userFiles: UserFiles,
  mayDiscard: () => Promise<boolean>,
  askPicture: AskPicture,
  propose: Propose,
): (files: readonly File[]) => Promise<void> {
  /** A sheet whose picture the user has not opened yet. */
  const sheet = new Observable<Sheet | null>(null)
  let isAsking = false
  const mayReplace = async (): Promise<boolean> => !store.hasUnsavedEdits.value || mayDiscard()

  async function use(text: string): Promise<void> {
    if ((await mayReplace()) && (await builder.use({ text }))) store.isBuilding.value = true
  }

  async function openPicture(file: File, own: Sheet | null): Promise<void> {
    try {
      const picture = await readPicture(file)
      const known = own ?? sheet.value
      sheet.value = known && (own || stemOf(known.image) === stemOf(file.name)) ? known : null
      if (!(await mayReplace())) return
      isAsking = true
      const isUsed = await askPicture(picture, sheet, (options) => builder.importTrack(picture, options))
      if (isUsed) store.isBuilding.value = true
    } catch (error) {
      store.warning.value = error instanceof Error ? error.message : String(error)
    }
    isAsking = false
    sheet.value = null
  }

  async function openText(file: File): Promise<void> {
    if (file.size > MAX_FILE) {
      store.warning.value = `The file ${file.name} has ${file.size} bytes; at most ${MAX_FILE} are possible.`
      return
    }
    const text = await file.text()
    const found = sheetOf(file.name, text)
    if (!found) {
      if (text.trim()) store.notice.value = `Opening ${file.name}…`
      if (!text.trim()) store.warning.value = `The file ${file.name} is empty.`
      else if ((await mayReplace()) && (await userFiles.open(file.name, text)) && !isScenario(text))
        store.isBuilding.value = true
      return
    }
    sheet.value = found
    if (!isAsking)
      store.notice.value = `The file ${file.name} describes the picture ${found.image}. Drop that picture, too.`
  }

  async function open(files: readonly File[]): Promise<void> {
    const pictures = files.filter(({ name }) => /\.(png|pgm)$/i.test(name))
    const texts = files.filter(({ name }) => /\.ya?ml$/i.test(name))
    const other = files.find((file) => !pictures.includes(file) && !texts.includes(file))
    if (other)
      store.warning.value = `The file ${other.name} is not the YAML file or the picture (PNG, PGM) of a map or a track.`
    else if (pictures.length > 1 || texts.length > 1)
      store.warning.value = 'Drop one file only, or a picture with its YAML file.'
    else if (pictures.length === 0) await openText(texts[0])
    else if (isAsking) store.warning.value = 'Another picture is open. Close its window first.'
    else if (texts.length === 0) await openPicture(pictures[0], null)
    else {
      const own = sheetOf(texts[0].name, texts[0].size > MAX_FILE ? '' : await texts[0].text())
      if (own) await openPicture(pictures[0], own)
      else
        store.warning.value = `The file ${texts[0].name} does not describe a picture: it has no image and resolution.`
    }
  }

  window.addEventListener('dragover', (event) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault()
  })
  window.addEventListener('drop', (event) => {
    const files = [...(event.dataTransfer?.files ?? [])]
    if (files.length === 0) return
    event.preventDefault()
    void open(files)
  })
  window.addEventListener('beforeunload', (event) => {
    if (store.hasUnsavedEdits.value) event.preventDefault()
  })
  proposeMapOfLink(store, propose, use)
  return open
}

/** Proposes the map of the link once the simulator has a scene. */
function proposeMapOfLink(store: Store, propose: Propose, use: (text: string) => Promise<void>): void {
  const value = new URLSearchParams(location.hash.slice(1)).get(KEY)
  if (value === null) return
  let isOpened = false
  store.scene.watch((scene) => {
    if (isOpened || !scene || scene.timeline) return
    isOpened = true
    propose('Another map, which is in the link', async () => {
      const text = await unpacked(value)
      if (text === null) store.warning.value = 'The map in this link is not complete: the link was cut. Copy it again.'
      else await use(text)
    })
  })
}

/** Whether a text is that of a scenario. */
function isScenario(text: string): boolean {
  return /^(map|vehicles)\s*:/m.test(text)
}

/** A name without its ending. */
function stemOf(name: string): string {
  return name.replace(/\.\w+$/, '')
}
