// Colours of the style sheet for canvases, which cannot evaluate light-dark() themselves.

/** Calls `take` with the colours of these custom properties, now and whenever the theme changes. */
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
