// Times of laps as people read them.

/** M:SS.mmm; a dash without a time. */
export function lapTime(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !(seconds > 0) || !Number.isFinite(seconds)) return '–'
  const thousandths = Math.round(1000 * seconds)
  const [minutes, rest] = [Math.floor(thousandths / 60000), thousandths % 60000]
  return `${minutes}:${String(Math.floor(rest / 1000)).padStart(2, '0')}.${String(rest % 1000).padStart(3, '0')}`
}
