// How the overlays of the scene look, for the scene and for its legend.

/** Length of an arrow for the force that the legend names [m]. */
export const ARROW = 0.1

/** Colours of the overlays: red, green, blue and opacity. */
export const OVERLAY_COLOURS = {
  vehicle: [0.2, 0.9, 1, 0.9],
  object: [1, 0.62, 0.15, 0.9],
  fixed: [1, 0.45, 0.9, 1],
  wheel: [0.75, 1, 0.2, 1],
  body: [1, 0.3, 0.25, 1],
  axes: [
    [1, 0.25, 0.2, 1],
    [0.25, 0.85, 0.3, 1],
    [0.3, 0.5, 1, 1],
  ],
  name: [1, 1, 1, 1],
} as const
