// A picture of a map, and the YAML file of map_server that belongs to it.
import { MAX_FILE, through } from './bytes'

/** A picture that becomes a race track. */
export interface Picture {
  /** Of its file. */
  name: string
  /** The file, compressed if that is shorter. */
  bytes: Uint8Array
  /** [pixels]. */
  width: number
  height: number
  /** What the screen shows. */
  image: ImageBitmap
}

/** A YAML file of map_server. */
export interface Sheet {
  name: string
  text: string
  /** Name of its picture. */
  image: string
}

/** What the user says about a picture. */
export interface PictureOptions {
  /** The YAML file. */
  text: string
  /** A place of the start line [pixels], from the upper left corner. */
  start: [number, number] | null
  gap: number
  is_reversed: boolean
}

/** The sheet of a text; null if it is none. */
export function sheetOf(name: string, text: string): Sheet | null {
  const image = /^image\s*:\s*(.+?)\s*$/m.exec(text)?.[1].replace(/^(["'])(.*)\1$/, '$2')
  return image && /^resolution\s*:/m.test(text) ? { name, text, image: image.replace(/^.*[\\/]/, '') } : null
}

/** A sheet for a picture without one, whose middle is the origin; `resolution` [m] of a pixel. */
export function plainSheet(picture: Picture, resolution: number, isDark: boolean): string {
  const origin = [-0.5 * picture.width * resolution, -0.5 * picture.height * resolution, 0].map((one) => one.toFixed(6))
  const lines = [`image: ${JSON.stringify(picture.name)}`, `resolution: ${resolution.toFixed(9)}`]
  return [
    ...lines,
    `origin: [${origin}]`,
    `negate: ${isDark ? 1 : 0}`,
    'occupied_thresh: 0.5',
    'free_thresh: 0.4',
  ].join('\n')
}

/** Reads a file. Throws an error that says what is wrong with it. */
export async function readPicture(file: File): Promise<Picture> {
  const plain = new Uint8Array(await file.arrayBuffer())
  const image = await imageOf(file, plain)
  // a PNG is compressed already
  const isPng = plain[0] === 0x89
  const bytes = isPng ? plain : await through(plain, new CompressionStream('deflate'), plain.length + MAX_FILE)
  if (bytes.length > MAX_FILE)
    throw new Error(
      `The file ${file.name} has ${bytes.length} bytes; at most ${MAX_FILE} are possible. Save it as 8-bit grey PNG, or smaller.`,
    )
  return { name: file.name, bytes, width: image.width, height: image.height, image }
}

async function imageOf(file: File, bytes: Uint8Array): Promise<ImageBitmap> {
  try {
    return await createImageBitmap(bytes[0] === 0x50 ? greyImage(bytes) : file)
  } catch {
    throw new Error(`The file ${file.name} is no PNG or PGM picture, or it is not complete.`)
  }
}

/** The image of a PGM file. */
function greyImage(bytes: Uint8Array): ImageData {
  const start = new TextDecoder('latin1').decode(bytes.subarray(0, 2000))
  const header = /^P([25])(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s/.exec(start)
  if (!header) throw new RangeError('no PGM')
  const [width, height, greatest] = header.slice(2).map(Number)
  const body = bytes.subarray(header[0].length)
  const values = header[1] === '2' ? new TextDecoder('latin1').decode(body).trim().split(/\s+/).map(Number) : body
  const step = header[1] === '5' && greatest > 255 ? 2 : 1
  const image = new ImageData(width, height)
  const scale = (step === 2 ? 65280 : 255) / greatest
  if (values.length < step * width * height) throw new RangeError('cut')
  for (let i = 0; i < width * height; i++) image.data.fill(scale * values[step * i], 4 * i, 4 * i + 3)
  for (let i = 3; i < image.data.length; i += 4) image.data[i] = 255
  return image
}
