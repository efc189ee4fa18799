// Bytes of files: their limit, and compression.

/** Largest file that the simulator accepts [bytes]. */
export const MAX_FILE = 2 ** 20

/** The bytes after a codec. Throws a `RangeError` if they are more than the limit. */
export async function through(
  bytes: Uint8Array<ArrayBuffer>,
  codec: GenericTransformStream,
  limit: number,
): Promise<Uint8Array> {
  const reader = new Blob([bytes]).stream().pipeThrough(codec).getReader()
  const parts: Uint8Array<ArrayBuffer>[] = []
  let length = 0
  for (;;) {
    const { done, value } = await reader.read()
    if (done) return new Uint8Array(await new Blob(parts).arrayBuffer())
    length += value.length
    if (length > limit) throw new RangeError('too long')
    parts.push(value)
  }
}
