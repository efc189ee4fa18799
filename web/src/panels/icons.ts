// Icon paths on a 24 x 24 grid, for `icon`.

export const MENU = 'M4 7h16M4 12h16M4 17h16'
// a steering wheel
export const MODE =
  'M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M12 10a2 2 0 1 0 0 4 2 2 0 0 0 0-4M10 12H3.2M14 12h6.8M12 14v6.8'
export const RESET = 'M5 4v5h5M5.5 9A8 8 0 1 1 4 13'
export const HUD = 'M4 19a8 8 0 1 1 16 0M12 19l4-6'
export const LEFT_INDICATOR = 'M10.5 5.5 3.5 12l7 6.5V15H20V9h-9.5z'
export const RIGHT_INDICATOR = 'M13.5 5.5 20.5 12l-7 6.5V15H4V9h9.5z'
export const HAZARD = 'M12 4 2.5 20h19zM12 10l-4 6.7h8z'
export const LOW_BEAM = 'M13 5c5 0 8 3 8 7s-3 7-8 7c-1.5-4-1.5-10 0-14M9 7l-6 2M8 11.5l-6 2M8.5 16l-6 2'
export const HIGH_BEAM = 'M13 5c5 0 8 3 8 7s-3 7-8 7c-1.5-4-1.5-10 0-14M9 7H3M8 12H2M9 17H3'
export const EDIT = 'M4 20l1-5L16 4l4 4L9 19zM14 6l4 4'
// a road with its middle line, and a bend
export const BUILD = 'M4 20V9a5 5 0 0 1 5-5h11M10 20V10h10M7 20v-3M7 13v-3M12 7h3'
export const MIRROR = 'M12 3v18M9 7 4 17h5zM15 7l5 10h-5z'
export const COPY = 'M9 9h11v11H9zM5 15H4V4h11v1'
export const START = 'M5 21V4h14l-3 4.5 3 4.5H5'
export const SHOW_ALL = 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5M9 9h6v6H9z'
export const LOOP = 'M14 5H8a5 5 0 0 0 0 14h8a5 5 0 0 0 4.6-7M17 2l-3 3 3 3'
export const SET = 'M5 12.5 10 17 19.5 7'
export const CAMERA = 'M4 8h3l2-3h6l2 3h3v11H4zM12 9.5a3.5 3.5 0 1 1 0 7a3.5 3.5 0 1 1 0-7'
// a vehicle from the side, and an arrow to the next
export const VEHICLE =
  'M3 18v-4l2.5-1 2-4h6l3 4 4.5 1v4zM7.5 16.4a1.6 1.6 0 1 1 0 3.2a1.6 1.6 0 1 1 0-3.2M16.5 16.4a1.6 1.6 0 1 1 0 3.2a1.6 1.6 0 1 1 0-3.2M13 4h7M17.5 1.5 20 4l-2.5 2.5'
export const ADD = 'M12 5v14M5 12h14'
export const REMOVE = 'M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13M10 11v5M14 11v5'
// a box that is turned, with the way of one corner
export const TURN_LEFT = 'M8 13.5 14.5 11l2.5 6.5-6.5 2.5zM4 5v5h5M4.3 9.8A9 9 0 0 1 20 9'
export const TURN_RIGHT = 'M16 13.5 9.5 11 7 17.5l6.5 2.5zM20 5v5h-5M19.7 9.8A9 9 0 0 0 4 9'
export const UNDO = 'M8 5 3.5 9.5 8 14M4 9.5h10a5 5 0 0 1 0 10h-3'
export const REDO = 'M16 5l4.5 4.5L16 14M20 9.5H10a5 5 0 0 0 0 10h3'
export const SAVE = 'M12 4v11M7 10.5l5 5 5-5M4 19.5h16'
export const DETAILS = 'M4 7h9M17 7h3M4 17h3M11 17h9M15 5v4M9 15v4'
export const PLAY = 'M8 5v14l11-7z'
export const PAUSE = 'M8 5v14M16 5v14'
export const STEP = 'M7 6v12l8-6zM18 6v12'
export const STEP_BACK = 'M17 6v12l-8-6zM6 6v12'
export const NEXT_EVENT = 'M4 7v10l6-5zM12 7v10l6-5zM20 6v12'
export const PREVIOUS_EVENT = 'M20 7v10l-6-5zM12 7v10l-6-5zM4 6v12'
export const PLOT = 'M4 4v16h16M7 15l4-6 4 4 4-7'
export const RECORD = 'M12 7a5 5 0 1 0 0 10 5 5 0 0 0 0-10'
// weathers
export const SUN =
  'M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8M12 2v3M12 19v3M2 12h3M19 12h3M5 5l2 2M17 17l2 2M19 5l-2 2M7 17l-2 2'
const CLOUD_SHAPE = 'h9a4 4 0 0 0 .4-8 5.5 5.5 0 0 0-10.6 1.2A3.5 3.5 0 0 0 7 '
export const CLOUD = `M7 18${CLOUD_SHAPE}18`
const HIGH_CLOUD = `M7 14${CLOUD_SHAPE}14`
export const LIGHT_FOG = `${HIGH_CLOUD}M5 18h14`
export const HEAVY_FOG = `${HIGH_CLOUD}M4 17h16M6 20h12M4 23h16`
export const LIGHT_RAIN = `${HIGH_CLOUD}M9 17l-1 3M15 17l-1 3`
export const HEAVY_RAIN = `${HIGH_CLOUD}M7 17l-2 5M11 17l-2 5M15 17l-2 5M19 17l-2 5`
export const LIGHT_SNOW = `${HIGH_CLOUD}M8 17v4M6.3 18l3.4 2M9.7 18l-3.4 2`
export const HEAVY_SNOW = `${LIGHT_SNOW}M16 17v4M14.3 18l3.4 2M17.7 18l-3.4 2`
