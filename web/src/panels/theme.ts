// Dark or light, as the system says or as the person chose.

export type Theme = 'system' | 'light' | 'dark'

const KEY = 'autodrive.theme'

/** What was chosen before, in this browser. */
export function chosenTheme(): Theme {
  try {
    const theme = localStorage.getItem(KEY)
    return theme === 'light' || theme === 'dark' ? theme : 'system'
  } catch {
    return 'system' // a browser that keeps nothing
  }
}

export function setTheme(theme: Theme): void {
  showTheme(theme)
  try {
    localStorage.setItem(KEY, theme)
  } catch {
    // a browser that keeps nothing: the choice holds for this page
  }
}

export function showTheme(theme: Theme): void {
  if (theme === 'system') delete document.documentElement.dataset.theme
  else document.documentElement.dataset.theme = theme
}
