// The colour map turbo (A. Mikhailov, 2019) by samples at equal distances, between which colours are linear.

const SAMPLES = [
  ...['#30123b', '#4145ab', '#4675ed', '#39a2fc', '#1bcfd4', '#24eca6', '#61fc6c', '#a4fc3b'],
  ...['#d1e834', '#f3c63a', '#fe9b2d', '#f36315', '#d93806', '#b11901', '#7a0402'],
]

/** Red, green and blue of each sample, 0 to 1. */
export const TURBO = SAMPLES.map((hex) => [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255))

/** As the background of a bar, from left to right. */
export const TURBO_GRADIENT = `linear-gradient(to right, ${SAMPLES.join(', ')})`
