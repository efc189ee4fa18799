// Round numbers for the ticks of axes.

/** The smallest of 1, 2, 5 times a power of ten that is at least `value`. */
export function niceStep(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value))
  const steps = [1, 2, 5, 10].map((factor) => factor * power)
  return steps.find((step) => step >= value * (1 - 1e-9)) ?? 10 * power
}

/** Three to five round numbers that enclose all finite `values` and span at least `span`. */
export function niceTicks(values: readonly (number | null)[], span: number): number[] {
  let low = Infinity
  let high = -Infinity
  for (const value of values) {
    if (value === null || !Number.isFinite(value)) continue
    if (value < low) low = value
    if (value > high) high = value
  }
  if (low > high) [low, high] = [0, span]
  const missing = span - (high - low)
  if (missing > 0) [low, high] = [low - missing / 2, high + missing / 2]
  const step = niceStep((high - low) / 3)
  const first = Math.floor(low / step + 1e-9)
  const last = Math.ceil(high / step - 1e-9)
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step)
}

/** Formats a tick with the number of decimals that `step` needs. */
export function tickText(value: number, step: number): string {
  if (value === 0) return '0'
  if (Math.abs(value) >= 1e5) return value.toExponential(0)
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9))
  return value.toFixed(Math.min(decimals, 4))
}

/** Force of an arrow of the legend [N]: 1, 2 or 5 times a power of ten, the next above the mean of the forces; 0 without any. */
export function scaleFor(forces: Float64Array): number {
  const sizes: number[] = []
  for (let i = 0; i < forces.length; i += 3) sizes.push(Math.hypot(...forces.subarray(i, i + 3)))
  const mean = sizes.reduce((sum, size) => sum + size, 0) / (sizes.length || 1)
  return mean > 1e-6 ? niceStep(mean) : 0
}
