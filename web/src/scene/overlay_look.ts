// How the overlays of the scene look, for the scene and for its legend; the images of the simulator have the same.
import LOOK from '../../../src/autodrive/graphics/render/overlays.json'

/** Length of an arrow for the force that the legend names [m]. */
export const ARROW = LOOK.arrow

/** Colours of the overlays: red, green, blue and opacity. */
export const OVERLAY_COLOURS = LOOK.colours

/** Sizes [m] and times [s]. */
export const OVERLAY_SIZES = LOOK
