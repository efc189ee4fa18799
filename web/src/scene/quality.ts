// Quality profiles of the 3D view, and their choice by measured frame times.
import type { Quality } from '../store'

export interface Profile {
  name: 'light' | 'low' | 'high' | 'ultra'
  /** Maximum number of image pixels per CSS pixel. */
  pixelRatio: number
  /** Samples per pixel (MSAA); 0: jagged edges are smoothed afterwards (FXAA). */
  samples: number
  /** Size of the shadow maps [pixels]: static objects, vehicles, one headlight (0: no shadows). */
  stillMap: number
  casterMap: number
  beamMap: number
  /** Width of the soft edge of shadows [texels]; 1: hard shadows, 0: no shadows. */
  softness: number
  /** Distance from the camera beyond which vehicles have reduced detail [m]. */
  fullDetail: number
  /** No reflections, for software rendering. */
  isLightweight: boolean
  anisotropy: number
}

export const PROFILES: Record<Profile['name'], Profile> = {
  light: {
    ...{ name: 'light', pixelRatio: 0.75, samples: 0, stillMap: 1024, casterMap: 1024, beamMap: 0, softness: 1 },
    ...{ fullDetail: 0, isLightweight: true, anisotropy: 1 },
  },
  low: {
    ...{ name: 'low', pixelRatio: 1, samples: 0, stillMap: 1024, casterMap: 1024, beamMap: 512, softness: 1 },
    ...{ fullDetail: 0, isLightweight: false, anisotropy: 2 },
  },
  high: {
    ...{ name: 'high', pixelRatio: 1.5, samples: 4, stillMap: 2048, casterMap: 2048, beamMap: 512, softness: 3 },
    ...{ fullDetail: 4, isLightweight: false, anisotropy: 4 },
  },
  ultra: {
    ...{ name: 'ultra', pixelRatio: 2, samples: 4, stillMap: 4096, casterMap: 4096, beamMap: 1024, softness: 5 },
    ...{ fullDetail: Infinity, isLightweight: false, anisotropy: 8 },
  },
}

const AUTO_PROFILES: Profile['name'][] = ['light', 'low', 'high']
const SOFTWARE = /swiftshader|llvmpipe|softpipe|microsoft basic|software/i

/** Frame times above which the profile is lowered, and below which it may be raised [ms]. */
const SLOW = 28
const FAST = 18
/** Below this frame rate in the lowest profile the simulator renders the scene [Hz]. */
const MIN_RATE = 8
/** Times after which the profile is lowered, replaced by remote rendering, or raised [s]. */
const LOWER_AFTER = 2.5
const REMOTE_AFTER = 5
const RAISE_AFTER = 60

export function isSoftware(renderer: string): boolean {
  return SOFTWARE.test(renderer)
}

/** Chooses the profile: as selected, or by measured frame times for 'auto'. */
export class QualityChoice {
  private step: number
  private times: number[] = []
  private since = 0
  private wasRaised = false

  constructor(private readonly isSoftware: boolean) {
    this.step = isSoftware ? 0 : AUTO_PROFILES.length - 1
  }

  profile(quality: Quality): Profile {
    if (quality === 'auto' || quality === 'stream') return PROFILES[AUTO_PROFILES[this.step]]
    return PROFILES[quality === 'low' && this.isSoftware ? 'light' : quality]
  }

  /** Discards the measurements, after something else took time. */
  restart(now: number): void {
    this.times = []
    this.since = now
  }

  /** Adds a frame time [s] measured at `now` [s]; returns whether the profile changed, or all are too slow. */
  measure(duration: number, now: number): 'stay' | 'change' | 'too-slow' {
    this.times.push(1000 * duration)
    const enough = duration > 0.5 ? 3 : 6
    if (now - this.since < LOWER_AFTER || this.times.length < enough) return 'stay'
    const median = this.times.slice().sort((a, b) => a - b)[this.times.length >> 1]
    if (median > SLOW && this.step > 0) return this.changeBy(-1, now)
    if (median > 1000 / MIN_RATE && now - this.since > REMOTE_AFTER) return 'too-slow'
    const canRaise = !this.isSoftware && !this.wasRaised && this.step < AUTO_PROFILES.length - 1
    if (canRaise && median < FAST && now - this.since > RAISE_AFTER) {
      this.wasRaised = true
      return this.changeBy(1, now)
    }
    if (this.times.length > 240) this.times = this.times.slice(-120)
    return 'stay'
  }

  private changeBy(steps: number, now: number): 'change' {
    this.step += steps
    this.restart(now)
    return 'change'
  }
}
