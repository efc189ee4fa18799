// The scene in words for screen readers, on demand: an invisible line that is written anew each second.
import type { Store } from '../store'
import { h, setText } from './element'
import { fixed, nearestRay, yawOf } from './hud_rows'
import type { VehicleEvents } from './vehicle_events'

/** [ms] */
const PERIOD = 1000
const DEGREE = Math.PI / 180

export function description(store: Store, events: VehicleEvents): HTMLElement {
  const element = h('p', { class: 'visually-hidden', testid: 'description', role: 'status' })
  let timer = 0
  store.isDescribed.watch((isDescribed) => {
    window.clearInterval(timer)
    setText(element, '')
    if (!isDescribed) return
    const write = () => setText(element, describeScene(store, events))
    timer = window.setInterval(write, PERIOD)
    write()
  })
  return element
}

/** Where the selected vehicle is, how it drives, and what is near. */
export function describeScene(store: Store, events: VehicleEvents): string {
  const name = store.vehicle.value
  const frame = store.frame.value
  const vehicle = frame?.vehicles[name]
  if (store.link.value === 'lost') return 'The connection to the simulator is lost.'
  if (!frame || !vehicle) return 'There is no vehicle yet.'
  const [x, y] = vehicle.pose.position
  const speed = Number(fixed(vehicle.velocity[0]))
  const motion =
    speed === 0 ? 'stands' : `drives ${speed > 0 ? 'forward' : 'in reverse'} at ${fixed(Math.abs(speed))} m/s`
  const parts = [
    `${name} ${motion} at x ${fixed(x)} m, y ${fixed(y)} m, heading ${fixed(yawOf(vehicle.pose) / DEGREE, 0)} degrees`,
    events.isOffRoad(name) ? 'off the road' : 'on the road',
    nearest(store, name),
    vehicle.collision_count > 0 && `${vehicle.collision_count} collisions`,
    `${frame.scene_light ? 'day' : 'night'}, camera ${store.camera.value}`,
  ]
  return `${parts.filter(Boolean).join('; ')}.`
}

function nearest(store: Store, name: string): string {
  const scan = store.scans.get(name)
  const ray = scan ? nearestRay(scan) : -1
  if (!scan || ray < 0) return ''
  const turn = scan.angle_min + ray * scan.angle_increment + yawOf(store.scene.value?.vehicles[name]?.lidar)
  const degrees = Math.round(Math.atan2(Math.sin(turn), Math.cos(turn)) / DEGREE)
  const side = degrees === 0 ? 'ahead' : `${Math.abs(degrees)} degrees to the ${degrees > 0 ? 'left' : 'right'}`
  return `nearest obstacle ${fixed(scan.ranges[ray])} m, ${side}`
}
