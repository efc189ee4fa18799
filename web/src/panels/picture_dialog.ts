// The dialog that makes a race track of a picture: its scale, the start line, the driving direction.
import { type Picture, type PictureOptions, plainSheet, type Sheet } from '../building/picture'
import type { Observable } from '../observable'
import { clamp } from '../scene/clamp'
import { contextOf } from './canvas'
import { numberField } from './edit'
import { h, setText } from './element'
import { labelled, segments } from './fields'

type Point = [number, number]
/** What a click sets: an end of the line, or the start. */
type Mode = 'scale' | 'start'

/** Directions of the arrow keys. */
const STEPS: Record<string, Point> = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }
/** Edge of a pixel that the simulator accepts [m]. */
const RESOLUTION = { min: 0.0001, max: 10 }

/** Shows the picture until `use` has no problem or the user closes the dialog; returns whether it was used. */
export function askPicture(
  picture: Picture,
  sheet: Observable<Sheet | null>,
  use: (options: PictureOptions) => Promise<readonly string[]>,
): Promise<boolean> {
  /** Ends of the line whose length the user knows [pixels]. */
  let line: Point[] = []
  let start: Point | null = null
  let mode: Mode = 'scale'
  /** The cross that the arrow keys move [pixels]. */
  let cross: Point = [picture.width / 2, picture.height / 2]

  const keys = 'Arrow keys move the cross, with Shift by a pixel; Enter sets the point'
  const canvas = h('canvas', {
    ...{ class: 'picture-canvas', testid: 'picture-canvas', tabIndex: 0, role: 'application' },
    ...{ 'aria-label': `Picture. ${keys}.`, title: keys },
    ...{ onclick: click, onkeydown: onKey, onfocus: () => draw(), onblur: () => draw() },
  })
  const scaleText = h('p', { testid: 'picture-scale', role: 'status' })
  const modes = segments<Mode>(
    'picture-mode',
    'What a click sets',
    [
      ['scale', 'Measure a length'],
      ['start', 'Start line'],
    ],
    (value) => {
      mode = value
      show()
    },
  )
  const length = numberField('picture-length', { min: 0.01, step: 'any', value: 1, oninput: () => measure() })
  const resolution = numberField('picture-resolution', { ...RESOLUTION, step: 'any', oninput: () => show() })
  const isDark = h('input', { type: 'checkbox', testid: 'picture-dark', role: 'switch' })
  const isReversed = h('input', { type: 'checkbox', testid: 'picture-reverse', role: 'switch' })
  const gap = numberField('picture-gap', { min: 0, max: 2, step: 0.05, value: 0 })
  const own = [
    labelled('Length of the line [m]', length),
    labelled('Or: edge of a pixel [m]', resolution),
    labelled('Dark areas are free', isDark),
  ]
  const problem = h('p', { class: 'error', testid: 'picture-error', role: 'alert', hidden: true })
  const submit = h('button', { type: 'submit', class: 'primary', testid: 'picture-use' }, 'Make the track')
  const close = h('button', { type: 'button', testid: 'picture-cancel', onclick: () => dialog.close() }, 'Cancel')
  const form = h(
    'form',
    { class: 'question-body', onsubmit: (event: SubmitEvent) => void send(event) },
    ...[canvas, scaleText, modes.element, ...own],
    labelled('Close openings of the walls below [m]', gap),
    labelled('Drive clockwise', isReversed),
    problem,
    h('div', { class: 'row' }, close, submit),
  )
  const title = `Track from ${picture.name}`
  const heading = h('header', {}, h('h2', {}, title))
  const dialog = h('dialog', { class: 'help question picture', testid: 'picture', 'aria-label': title }, heading, form)
  let isUsed = false

  function click(event: MouseEvent): void {
    const box = canvas.getBoundingClientRect()
    set([
      ((event.clientX - box.left) / box.width) * picture.width,
      ((event.clientY - box.top) / box.height) * picture.height,
    ])
  }

  function onKey(event: KeyboardEvent): void {
    const { width, height } = picture
    const step = event.shiftKey ? 1 : Math.max(1, Math.round(width / 50))
    const way = STEPS[event.key]
    if (way) cross = [clamp(cross[0] + step * way[0], [0, width - 1]), clamp(cross[1] + step * way[1], [0, height - 1])]
    else if (event.key === 'Enter' || event.key === ' ') set(cross)
    else return
    event.preventDefault()
    draw()
  }

  function set(at: Point): void {
    cross = at
    if (mode === 'start') start = at
    else {
      line = line.length === 1 ? [...line, at] : [at]
      measure()
    }
    show()
  }

  /** Computes the edge of a pixel from the line. */
  function measure(): void {
    if (line.length < 2) return
    const pixels = Math.hypot(line[1][0] - line[0][0], line[1][1] - line[0][1])
    if (pixels >= 1) resolution.value = String(Number((Number(length.value) / pixels).toPrecision(5)))
    show()
  }

  function show(): void {
    const found = sheet.value
    if (found) mode = 'start'
    for (const one of own) one.hidden = found !== null
    modes.element.hidden = found !== null
    modes.show(mode)
    const edge = Number(resolution.value)
    submit.disabled = !found && !(edge >= RESOLUTION.min && edge <= RESOLUTION.max)
    const size = [picture.width, picture.height].map((one) => `${(one * edge).toFixed(1)} m`).join(' x ')
    const how =
      mode === 'start'
        ? 'Click the track where the start line shall be. Keys: Tab to the picture, arrow keys, Enter.'
        : 'Click two places of which you know the distance. Or drop the YAML file of map_server that belongs to the picture.'
    if (found) setText(scaleText, `${found.name} has the scale. ${how}`)
    else setText(scaleText, edge > 0 ? `The picture is ${size} large. ${how}` : how)
    draw()
  }

  function draw(): void {
    const area = contextOf(canvas)
    if (!area) return
    const { context, width, height } = area
    context.imageSmoothingEnabled = picture.width > width
    context.drawImage(picture.image, 0, 0, width, height)
    const [fx, fy] = [width / picture.width, height / picture.height]
    context.strokeStyle = context.fillStyle = getComputedStyle(canvas).color
    context.lineWidth = 3
    context.font = '13px sans-serif'
    context.beginPath()
    if (!sheet.value) for (const [x, y] of line) context.lineTo(x * fx, y * fy)
    context.stroke()
    for (const [x, y] of [...(sheet.value ? [] : line), ...(start ? [start] : [])]) {
      context.beginPath()
      context.arc(x * fx, y * fy, 5, 0, 2 * Math.PI)
      context.fill()
    }
    if (start) context.fillText('Start', start[0] * fx + 9, start[1] * fy + 4)
    if (document.activeElement !== canvas || !canvas.matches(':focus-visible')) return
    const [x, y] = [cross[0] * fx, cross[1] * fy]
    context.beginPath()
    for (const [dx, dy] of Object.values(STEPS)) {
      context.moveTo(x + 4 * dx, y + 4 * dy)
      context.lineTo(x + 14 * dx, y + 14 * dy)
    }
    context.stroke()
  }

  async function send(event: SubmitEvent): Promise<void> {
    event.preventDefault()
    const text = sheet.value?.text ?? plainSheet(picture, Number(resolution.value), isDark.checked)
    submit.disabled = true
    setText(submit, 'Please wait…')
    const options = { text, start, gap: Number(gap.value), is_reversed: isReversed.checked }
    const errors = await use(options)
    setText(submit, 'Make the track')
    problem.hidden = errors.length === 0
    setText(problem, errors.join('\n'))
    isUsed = errors.length === 0
    if (isUsed) dialog.close()
    else show()
  }

  canvas.style.aspectRatio = `${picture.width} / ${picture.height}`
  canvas.style.maxWidth = `calc(var(--picture-height) * ${picture.width / picture.height})`
  document.body.append(dialog)
  dialog.showModal()
  const stop = sheet.watch(show)
  return new Promise((resolve) => {
    dialog.addEventListener('close', () => {
      stop()
      dialog.remove()
      resolve(isUsed)
    })
  })
}
