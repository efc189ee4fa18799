// The theme: dark, light, or that of the system.
import { loadPreference, savePreference } from './preferences'

export type Theme = 'system' | 'light' | 'dark'

/** The saved theme. */
export function savedTheme(): Theme {
  const theme = loadPreference('theme')
  return theme === 'light' || theme === 'dark' ? theme : 'system'
}

export function setTheme(theme: Theme): void {
  showTheme(theme)
  savePreference('theme', theme)
}

export function showTheme(theme: Theme): void {
  if (theme === 'system') delete document.documentElement.dataset.theme
  else document.documentElement.dataset.theme = theme
}
