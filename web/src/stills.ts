// The still pictures of the scenarios, made by `python -m tests.support.stills`.

const ADDRESSES = import.meta.glob<string>('./stills/*.webp', { eager: true, query: '?url', import: 'default' })

/** Address of the still picture of that name; null if there is none, as for scenarios of the user. */
export function stillOf(name: string): string | null {
  return ADDRESSES[`./stills/${name}.webp`] ?? null
}
