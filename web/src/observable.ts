// A value with change listeners.

export class Observable<T> {
  private readonly watchers = new Set<(value: T) => void>()

  constructor(private current: T) {}

  get value(): T {
    return this.current
  }

  set value(value: T) {
    this.current = value
    for (const watcher of this.watchers) watcher(value)
  }

  /** Calls `watcher` now and after each assignment; returns a function that removes it. */
  watch(watcher: (value: T) => void): () => void {
    this.watchers.add(watcher)
    watcher(this.current)
    return () => this.watchers.delete(watcher)
  }
}
