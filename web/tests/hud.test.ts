import { describe, expect, inject, test } from 'vitest'

import type { LidarScan } from '../src/messages'
import { RaceStatus } from '../src/messages'
import { History } from '../src/panels/history'
import { clock, fixed, type HudState, nearestRay, rangeAt, rayAt, TEXTS } from '../src/panels/hud_rows'
import { race as raceSection } from '../src/panels/hud_sections'
import { niceStep, niceTicks, tickText } from '../src/panels/scales'
import { SIGNALS } from '../src/panels/signals'
import { VehicleEvents } from '../src/panels/vehicle_events'
import { decodeFrame, frameOf, pose, scanOf, statusOf, vehicleOf } from './support'

function stateOf(values: Partial<HudState> = {}): HudState {
  const frame = frameOf()
  const vehicle = frame.vehicles.V1
  const common = { name: 'V1', scene: null, scan: null, bearing: 0, status: null, frameRate: 59.6, warmUpLaps: 0 }
  return { frame, vehicle, viewer: 'page-1', ...common, ...values }
}

describe('Frames of the simulator', () => {
  test.each(inject('hudFrames'))('$name', ({ frame: data, rows, beam, nearest }) => {
    const frame = decodeFrame(data)
    const vehicle = frame.vehicles.V1
    const scan = vehicle.lidar as LidarScan
    const state = stateOf({ frame, vehicle, scan })
    const texts = Object.entries(TEXTS).map(([row, text]) => [row, text(state)])
    expect(Object.fromEntries(texts)).toMatchObject(rows)
    beam.forEach((range, quarter) => {
      for (const turns of [-1, 0, 1]) {
        const bearing = (quarter / 4 + turns) * 2 * Math.PI
        expect(rangeAt({ scan, scene: null, bearing })).toBeCloseTo(range ?? Infinity, 9)
      }
    })
    if (nearest !== null) expect(nearestRay(scan)).toBe(nearest)
  })
})

describe('rows without values', () => {
  test('every row has a text before the first message', () => {
    const state = stateOf({ frame: null, vehicle: null })
    for (const [row, text] of Object.entries(TEXTS)) expect(text(state), row).toMatch(/^(–|60 Hz)$/)
  })

  test('the frame rate is rounded', () => expect(TEXTS['frame-rate'](stateOf())).toBe('60 Hz'))
})

describe('rows of the simulation', () => {
  const status = statusOf({
    ...{ clients: 2, real_time_factor: 0.987, drivers: { V1: 'page-1', V2: 'page-2' } },
    bridge: {
      ...{ address: '127.0.0.1:4567', state: 'connected', error: '' },
      ...{ telemetry_rate: 29.96, command_rate: 30.04, round_trip: 0.00123, devkit: '', note: '' },
    },
  })

  test('are those of the status', () => {
    const state = stateOf({ status })
    expect(TEXTS.rtf(state)).toBe('0.99 ×')
    expect(TEXTS.viewers(state)).toBe('2')
    expect(TEXTS.bridge(state)).toBe('Connected')
    expect(TEXTS.telemetry(state)).toBe('30.0 Hz')
    expect(TEXTS.commands(state)).toBe('30.0 Hz')
    expect(TEXTS['round-trip'](state)).toBe('1.2 ms')
  })

  test('the driver is this page, another client, or none', () => {
    expect(TEXTS.driver(stateOf({ status }))).toBe('You')
    expect(TEXTS.driver(stateOf({ status, name: 'V2' }))).toBe('page-2')
    expect(TEXTS.driver(stateOf({ status, name: 'V3' }))).toBe('None')
  })

  test('a bridge without round trips has none', () => {
    expect(TEXTS['round-trip'](stateOf({ status: statusOf() }))).toBe('–')
  })
})

describe('numbers', () => {
  test.each([
    [0, 2, '0.00'],
    [-0.004, 2, '0.00'],
    [-0.006, 2, '-0.01'],
    [1.005e3, 0, '1005'],
    [1e9, 2, '1.00e+9'],
    [-123456789012, 2, '-1.23e+11'],
    [NaN, 2, '–'],
    [null, 2, '–'],
    [Infinity, 2, 'inf'],
    [-Infinity, 1, '-inf'],
  ])('%d with %d decimals is %s', (value, decimals, text) => expect(fixed(value, decimals)).toBe(text))

  test('times longer than a day continue, negative and missing ones are shown as such', () => {
    expect(clock(100 * 3600)).toBe('100:00:00')
    expect(clock(-1)).toBe('00:00:00')
    expect(clock(NaN)).toBe('–')
  })

  test('an empty scan has no ranges', () => {
    expect(rangeAt({ scan: scanOf([]), scene: null, bearing: 0 })).toBeNaN()
    expect(rangeAt({ scan: null, scene: null, bearing: 0 })).toBeNaN()
    expect(nearestRay(scanOf([]))).toBe(-1)
  })

  test('the ray at an angle is the nearest one, and none outside the field of view', () => {
    const quarter = { angle_min: -0.2, angle_increment: 0.1 }
    const scan = scanOf([1, 2, 3, 4, 5], quarter) // -0.2 to 0.2 rad
    expect([-0.24, -0.16, 0.04, 0.24, 0.26, 3, -0.26].map((angle) => rayAt(scan, angle))).toEqual([
      0, 0, 2, 4, -1, -1, -1,
    ])
    const clockwise = scanOf([1, 2, 3, 4], { angle_min: 0, angle_increment: -Math.PI / 2 })
    expect([0, -Math.PI / 2, Math.PI / 2, Math.PI].map((angle) => rayAt(clockwise, angle))).toEqual([0, 1, 3, 2])
    const scene = { lidar: pose(0, 0, 0.1) } as HudState['scene'] // the sensor looks 0.1 rad to the left
    expect(rangeAt({ scan, scene, bearing: 0.2 })).toBe(4)
  })

  test('a minus infinity of the scan (too near to measure) is no return', () => {
    expect(nearestRay(scanOf([-Infinity, 3, 2, NaN]))).toBe(2)
  })
})

describe('ticks of axes', () => {
  test.each([
    [0.7, 1],
    [1, 1],
    [1.1, 2],
    [2.1, 5],
    [0.0501, 0.1],
    [3000, 5000],
  ])('the step for %d is %d', (value, step) => expect(niceStep(value)).toBeCloseTo(step, 12))

  test('enclose the values, and span a minimum', () => {
    const ticks = niceTicks([0.3, 4.2, null, NaN], 0.1)
    expect(ticks[0]).toBeLessThanOrEqual(0.3)
    expect(ticks[ticks.length - 1]).toBeGreaterThanOrEqual(4.2)
    expect(ticks.length).toBeGreaterThanOrEqual(3)
    expect(ticks.length).toBeLessThanOrEqual(6)
    const narrow = niceTicks([1, 1.0001], 2)
    expect(narrow[narrow.length - 1] - narrow[0]).toBeGreaterThanOrEqual(2)
    expect(niceTicks([], 1)[0]).toBe(0)
  })

  test('have the decimals of their step', () => {
    expect(tickText(0.30000000000000004, 0.1)).toBe('0.3')
    expect(tickText(20, 10)).toBe('20')
    expect(tickText(0, 0.01)).toBe('0')
    expect(tickText(2e5, 1e5)).toBe('2e+5')
  })
})

describe('the history of the plots', () => {
  const at = (time: number, speed = 0) => {
    const vehicle = vehicleOf({ velocity: new Float64Array([speed, 0, 0]) })
    return stateOf({ frame: frameOf(['V1'], { time }), vehicle })
  }

  test('keeps a column for each signal', () => {
    const history = new History()
    history.add(at(0, 0.1))
    history.add(at(0.1, 0.2))
    expect([...history.columns.keys()]).toEqual([...SIGNALS.keys()])
    expect([...(history.columns.get('speed') ?? [])].slice(0, history.length)).toEqual([0.1, 0.2])
  })

  test('has the values of the sensors of the user from their first reading on', () => {
    const history = new History()
    history.add(at(0))
    const own = { radar: { time: 0, values: new Float64Array([3, 4]), columns: ['distance [m]', 'count'] } }
    history.add(stateOf({ frame: frameOf(['V1'], { time: 0.1 }), vehicle: vehicleOf({ own }) }))
    expect([...(history.columns.get('own-radar-distance [m]') ?? [])].slice(0, 2)).toEqual([NaN, 3])
    const { group, label, unit } = SIGNALS.get('own-radar-distance [m]') ?? {}
    expect([group, label, unit]).toEqual(['Sensor radar', 'distance', 'm'])
    expect(SIGNALS.get('own-radar-count')?.unit).toBe('')
    expect(SIGNALS.get('own-radar-count')?.of(stateOf({ vehicle: vehicleOf() }))).toBeNaN()
  })

  test('skips Frames that follow too closely, and starts again when time goes back', () => {
    const history = new History()
    for (const time of [0, 0.01, 0.02, 0.021]) history.add(at(time))
    expect([...history.times.slice(0, history.length)]).toEqual([0, 0.02])
    history.add(at(0))
    expect(history.length).toBe(1)
  })

  test('keeps at least thirty seconds', () => {
    const history = new History()
    for (let i = 0; i < 5000; i++) history.add(at(0.016 * i))
    const last = history.times[history.length - 1]
    expect(last).toBeCloseTo(0.016 * 4999)
    expect(history.times[0]).toBeLessThanOrEqual(last - 30)
    expect(history.times[history.since(last - 10)]).toBeCloseTo(last - 10, 1)
    expect(history.times.slice(0, history.length)).toEqual(history.times.slice(0, history.length).sort())
  })

  test('adds nothing without a vehicle', () => {
    const history = new History()
    history.add(stateOf({ vehicle: null }))
    expect(history.length).toBe(0)
  })
})

describe('plotted signals', () => {
  test('are unique, and numbers for every vehicle', () => {
    const state = stateOf({ status: statusOf(), scan: scanOf([2, 1, 3]) })
    for (const [id, { of }] of SIGNALS) expect(typeof of(state), id).toBe('number')
    expect(SIGNALS.get('nearest')?.of(state)).toBe(1)
  })

  test('steering is positive to the left, with an arrow to the side of the turn', () => {
    const text = (steering: number) => TEXTS.steering(stateOf({ vehicle: vehicleOf({ steering }) }))
    expect(SIGNALS.get('steering')?.of(stateOf({ vehicle: vehicleOf({ steering: 0.25 }) }))).toBe(0.25)
    expect([0.25, -0.25, 0, -0.004].map(text)).toEqual(['← 0.25 rad', '→ -0.25 rad', '0.00 rad', '0.00 rad'])
  })

  test('a wheel has the signal of its index', () => {
    const vehicle = vehicleOf()
    vehicle.wheels.normal_load.set([1, 2, 3, 4])
    expect([0, 1, 2, 3].map((i) => SIGNALS.get(`load-${i}`)?.of(stateOf({ vehicle })))).toEqual([1, 2, 3, 4])
  })
})

describe('a race', () => {
  const race = {
    ...{
      status: RaceStatus.RACING,
      lap_count: 3,
      lap_total: 11,
      lap_time: 61.0449,
      last_lap_time: 20.6,
      checkpoint: 2,
    },
    ...{ best_lap_time: Infinity, race_time: 83, penalty: 10, collision_count: 1, distance: 220, rank: 2, gap: 1.26 },
    is_wrong_way: false,
  }
  const first = { ...race, lap_count: 4, rank: 1, gap: 0, best_lap_time: 19.9996 }
  const out = { ...race, status: RaceStatus.RETIRED, rank: 3 }

  test('rows are laps and times', () => {
    const state = stateOf({ vehicle: vehicleOf({ race }) })
    const rows = ['race-lap', 'race-lap-time', 'race-last-lap', 'race-best-lap', 'race-penalty'] as const
    expect(rows.map((row) => TEXTS[row](state))).toEqual(['3 / 11', '1:01.045', '0:20.600', '–', '10 s'])
    expect(TEXTS['race-lap'](stateOf({ vehicle: vehicleOf({ race: { ...race, lap_total: 0 } }) }))).toBe('3')
  })

  test('a warm-up lap that is counted is named', () => {
    const section = raceSection(new Map())
    const label = () => section.element.querySelector('.fact-race-lap dt')?.textContent
    section.refresh(stateOf({ vehicle: vehicleOf({ race }) }))
    expect(label()).toBe('Lap')
    section.refresh(stateOf({ vehicle: vehicleOf({ race }), warmUpLaps: 1 }))
    expect(label()).toBe('Lap, 1 warm-up')
  })

  test('standings are in the order of ranks, with gaps', () => {
    const section = raceSection(new Map())
    const frame = frameOf(['V1', 'V2', 'V3'])
    section.refresh(stateOf({ frame }))
    expect(section.element.hidden).toBe(true)
    frame.vehicles = { V1: vehicleOf({ race }), V2: vehicleOf({ race: first }), V3: vehicleOf({ race: out }) }
    section.refresh(stateOf({ frame, vehicle: frame.vehicles.V1 }))
    expect(section.element.hidden).toBe(false)
    const rows = [...section.element.querySelectorAll('tr')].slice(1)
    expect(rows.map((row) => [...row.children].map((cell) => cell.textContent))).toEqual([
      ['1', 'V2', '4', '', '0:20.000'],
      ['2', 'V1', '3', '+1.3 s', '–'],
      ['3', 'V3', '3', 'DNF', '–'],
    ])
    expect(rows.map((row) => row.getAttribute('aria-current'))).toEqual([null, 'true', null])
  })
})

describe('events of vehicles', () => {
  const position = new Float64Array(3)
  const off = { type: 'OffRoad' as const, time: 1, vehicle: 'V1', position }
  const back = { type: 'BackOnRoad' as const, time: 2, vehicle: 'V1', position }
  const hit = { type: 'Collision' as const, time: 3, vehicle: 'V1', other: 'wall', impulse: 0.5, position }

  test('road departures and collisions are kept by vehicle', () => {
    const events = new VehicleEvents()
    events.add([off, hit])
    expect(events.isOffRoad('V1')).toBe(true)
    expect(events.isOffRoad('V2')).toBe(false)
    expect(events.lastCollision('V1')).toBe(hit)
    events.add([back])
    expect(events.isOffRoad('V1')).toBe(false)
  })

  test('a reset drops later events', () => {
    const events = new VehicleEvents()
    events.add([off, hit])
    events.dropAfter(1.5)
    expect(events.isOffRoad('V1')).toBe(true)
    expect(events.lastCollision('V1')).toBeNull()
    events.dropAfter(0)
    expect(events.isOffRoad('V1')).toBe(false)
  })
})
