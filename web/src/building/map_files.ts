// Map and track files in the page: a file is dropped on it, a link contains the map, and edits are not lost unasked.
import type { Store } from '../store'
import type { Builder } from './builder'

/** Largest text of a map [characters]; the simulator accepts messages of 64 KiB. */
export const MAX_TEXT = 60_000
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
    const plain = await through(bytes, new DecompressionStream('deflate'), 4 * MAX_TEXT)
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

/** Opens files that are dropped on the page and the map of its link; asks before unsaved edits are lost. */
export function openMapFiles(store: Store, builder: Builder, mayDiscard: () => Promise<boolean>): void {
  async function use(text: string): Promise<void> {
    if (text.length > MAX_TEXT)
      store.warning.value = `A map has at most ${MAX_TEXT} characters; this one has ${text.length}.`
    else if (!store.hasUnsavedEdits.value || (await mayDiscard())) {
      if (await builder.use({ text })) store.isBuilding.value = true
    }
  }

  async function drop(files: readonly File[]): Promise<void> {
    const [file] = files
    if (files.length > 1) store.warning.value = 'Drop one file only: the YAML file of a map or a track.'
    else if (!/\.ya?ml$/i.test(file.name))
      store.warning.value = `${file.name} is not the YAML file of a map or a track.`
    else if (file.size > MAX_TEXT)
      store.warning.value = `${file.name} has ${file.size} bytes; a map has at most ${MAX_TEXT}.`
    else await use(await file.text())
  }

  window.addEventListener('dragover', (event) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault()
  })
  window.addEventListener('drop', (event) => {
    const files = [...(event.dataTransfer?.files ?? [])]
    if (files.length === 0) return
    event.preventDefault()
    void drop(files)
  })
  window.addEventListener('beforeunload', (event) => {
    if (store.hasUnsavedEdits.value) event.preventDefault()
  })
  const value = new URLSearchParams(location.hash.slice(1)).get(KEY)
  if (value === null) return
  let isOpened = false
  store.scene.watch((scene) => {
    if (isOpened || !scene || scene.timeline) return
    isOpened = true
    void unpacked(value).then((text) => {
      if (text === null) store.warning.value = 'The map in this link is not complete: the link was cut. Copy it again.'
      else void use(text)
    })
  })
}

async function through(
  bytes: Uint8Array<ArrayBuffer>,
  codec: GenericTransformStream,
  limit: number,
): Promise<Uint8Array> {
  const reader = new Blob([bytes]).stream().pipeThrough(codec).getReader()
  const parts: number[] = []
  for (;;) {
    const { done, value } = await reader.read()
    if (done) return Uint8Array.from(parts)
    if (parts.length + value.length > limit) throw new RangeError('too long')
    for (const byte of value) parts.push(byte)
  }
}
