// The colours of style.css for canvases, which cannot read light-dark() by themselves.

/** Calls back with the colours that these custom properties have now, and again when the theme changes. */
export function watchColours<Name extends string>(
  names: readonly Name[],
  take: (colours: Record<Name, string>) => void,
): void {
  const probe = document.createElement('span')
  probe.hidden = true
  document.body.append(probe)
  const read = () => {
    const colours = {} as Record<Name, string>
    for (const name of names) {
      probe.style.color = `var(--${name})`
      colours[name] = getComputedStyle(probe).color
    }
    take(colours)
  }
  read()
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', read)
  new MutationObserver(read).observe(document.documentElement, { attributeFilter: ['data-theme', 'style', 'class'] })
}

export interface Paper {
  context: CanvasRenderingContext2D
  width: number
  height: number
}

/** Makes a canvas as sharp as the screen; its context counts in CSS pixels. Null while it has no size. */
export function fit(canvas: HTMLCanvasElement): Paper | null {
  const width = canvas.clientWidth
  const height = canvas.clientHeight
  const context = canvas.getContext('2d')
  if (!context || width === 0 || height === 0) return null
  const ratio = Math.min(window.devicePixelRatio || 1, 2)
  const pixels = [Math.round(width * ratio), Math.round(height * ratio)] as const
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels
  context.setTransform(ratio, 0, 0, ratio, 0, 0)
  context.clearRect(0, 0, width, height)
  return { context, width, height }
}
