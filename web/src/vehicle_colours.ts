// The colours that distinguish the vehicles: in the 3D view, above the vehicles and on the small map.
import type { Scene } from './messages'

/** sRGB, in the order of the vehicles of the scene. Neighbours differ for colour-blind users, too. */
const COLOURS = ['#2f7fe0', '#f08c00', '#1fa362', '#d6336c', '#e6c700', '#7048e8', '#12a5b5', '#8a5a3c'] as const

/** The colour of a vehicle of the scene. */
export function vehicleColour(scene: Scene, vehicle: string): string {
  return COLOURS[Math.max(0, Object.keys(scene.vehicles).indexOf(vehicle)) % COLOURS.length]
}

/** Whether vehicles must be told apart. */
export function hasSeveralVehicles(scene: Scene): boolean {
  return Object.keys(scene.vehicles).length > 1
}
