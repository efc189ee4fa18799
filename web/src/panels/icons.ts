// Paths of icons on a 24 x 24 grid, for `icon`.

export const MENU = 'M4 7h16M4 12h16M4 17h16'
export const HUD = 'M4 19a8 8 0 1 1 16 0M12 19l4-6'
export const LEFT_INDICATOR = 'M10.5 5.5 3.5 12l7 6.5V15H20V9h-9.5z'
export const RIGHT_INDICATOR = 'M13.5 5.5 20.5 12l-7 6.5V15H4V9h9.5z'
export const HAZARD = 'M12 4 2.5 20h19zM12 10l-4 6.7h8z'
export const LOW_BEAM = 'M13 5c5 0 8 3 8 7s-3 7-8 7c-1.5-4-1.5-10 0-14M9 7l-6 2M8 11.5l-6 2M8.5 16l-6 2'
export const HIGH_BEAM = 'M13 5c5 0 8 3 8 7s-3 7-8 7c-1.5-4-1.5-10 0-14M9 7H3M8 12H2M9 17H3'
