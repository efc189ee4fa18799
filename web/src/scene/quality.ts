// What is spent on a picture, and how that follows what the machine can do.
import type { Quality } from '../store'

export interface Profile {
  name: 'light' | 'low' | 'high' | 'ultra'
  /** Pixels of the picture for one of the page, at most. */
  pixelRatio: number
  /** Of each pixel (MSAA). */
  samples: number
  /** Edges of the shadow maps [pixels]: of all that stands still, of all vehicles, of a headlight (0: none). */
  stillMap: number
  casterMap: number
  beamMap: number
  /** Soft edge of shadows [texels]; 1: a plain one, 0: no shadows. */
  softness: number
  /** Vehicles farther than this from the eye are drawn in the reduced detail [m]. */
  fullDetail: number
  /** Without gloss, for software GL. */
  isLightweight: boolean
  anisotropy: number
}

export const PROFILES: Record<Profile['name'], Profile> = {
  light: {
    ...{ name: 'light', pixelRatio: 0.5, samples: 0, stillMap: 1024, casterMap: 1024, beamMap: 0, softness: 1 },
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

const STEPS: Profile['name'][] = ['light', 'low', 'high']
const SOFTWARE = /swiftshader|llvmpipe|softpipe|microsoft basic|software/i

/** A picture that takes longer than this is too slow, and with less than that there is room for more [ms]. */
const SLOW = 28
const FAST = 18
/** Even the light profile draws fewer pictures than this: the simulator does it better [Hz]. */
const HOPELESS = 8
/** Times after which a profile is judged [s]. */
const PATIENCE = 2.5
const LAST_PATIENCE = 5
const TRUST = 60

export function isSoftware(renderer: string): boolean {
  return SOFTWARE.test(renderer)
}

/** Chooses the profile; 'auto' by how long pictures take. */
export class QualityChoice {
  private step: number
  private times: number[] = []
  private since = 0
  private wasLifted = false

  constructor(private readonly isSoftware: boolean) {
    this.step = isSoftware ? 0 : STEPS.length - 1
  }

  profile(quality: Quality): Profile {
    if (quality === 'auto' || quality === 'stream') return PROFILES[STEPS[this.step]]
    return PROFILES[quality === 'low' && this.isSoftware ? 'light' : quality]
  }

  /** Forgets what was measured: something else took time. */
  restart(now: number): void {
    this.times = []
    this.since = now
  }

  /** Takes the duration of a picture [s] at `now` [s]; whether another profile, or none of them, is better. */
  measure(duration: number, now: number): 'stay' | 'change' | 'hopeless' {
    this.times.push(1000 * duration)
    const enough = duration > 0.5 ? 3 : 6
    if (now - this.since < PATIENCE || this.times.length < enough) return 'stay'
    const median = this.times.slice().sort((a, b) => a - b)[this.times.length >> 1]
    if (median > SLOW && this.step > 0) return this.go(-1, now)
    if (median > 1000 / HOPELESS && now - this.since > LAST_PATIENCE) return 'hopeless'
    const canRise = !this.isSoftware && !this.wasLifted && this.step < STEPS.length - 1
    if (canRise && median < FAST && now - this.since > TRUST) {
      this.wasLifted = true
      return this.go(1, now)
    }
    if (this.times.length > 240) this.times = this.times.slice(-120)
    return 'stay'
  }

  private go(steps: number, now: number): 'change' {
    this.step += steps
    this.restart(now)
    return 'change'
  }
}
