// What the page remembers of a person's choices, where the browser lets it.

export function recall(key: string): string | null {
  try {
    return localStorage.getItem(`autodrive.${key}`)
  } catch {
    return null
  }
}

export function remember(key: string, value: string): void {
  try {
    localStorage.setItem(`autodrive.${key}`, value)
  } catch {
    // Storage is off or full: the choice lasts as long as the page.
  }
}
