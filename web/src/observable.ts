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

/** A switch that is off while there is a reason against it; `refuse` is called with the reason if it is turned on. */
export class GuardedSwitch extends Observable<boolean> {
  constructor(
    private readonly reason: () => string,
    private readonly refuse: (reason: string) => void,
  ) {
    super(false)
  }

  override get value(): boolean {
    return super.value
  }

  override set value(isOn: boolean) {
    const reason = isOn ? this.reason() : ''
    if (reason) this.refuse(reason)
    else super.value = isOn
  }
}
