// Preferences of the user, saved in the browser if it permits storage.

export function loadPreference(key: string): string | null {
  try {
    return localStorage.getItem(`autodrive.${key}`)
  } catch {
    return null
  }
}

export function savePreference(key: string, value: string): void {
  try {
    localStorage.setItem(`autodrive.${key}`, value)
  } catch {
    // Storage is disabled or full: the preference is lost when the page closes.
  }
}
