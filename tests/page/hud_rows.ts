// Reads a Frame as the page does, says what the HUD's rows say of its first vehicle, as JSON.
import { readFileSync } from 'node:fs'

import { Decoder, ExtensionCodec } from '../../web/node_modules/@msgpack/msgpack/dist.esm/index.mjs'
import { ARRAYS } from '../../web/src/messages'
import type { Frame, LidarScan } from '../../web/src/messages'
import { nearestRay, presentRange, TEXTS } from '../../web/src/panels/hud_rows'

const extensionCodec = new ExtensionCodec()
for (const [code, Values] of Object.entries(ARRAYS))
  extensionCodec.register({ type: Number(code), encode: () => null, decode: (data) => new Values(data.slice().buffer) })
const decoder = new Decoder({ extensionCodec })

const frame = decoder.decode(new Uint8Array(readFileSync(0))) as Frame
const [name, vehicle] = Object.entries(frame.vehicles)[0]!
const scan = vehicle.lidar as LidarScan
const moment = { frame, name, vehicle, scene: null, scan, status: null, frameRate: 59.6, viewer: 'page' }
const texts = Object.fromEntries(Object.entries(TEXTS).map(([row, text]) => [row, text(moment)]))
const times = [0, 0.25, 0.5, 0.75].map((share) => scan.time + (3 + share) / scan.scan_rate)
console.log(JSON.stringify({ ...texts, beam: times.map((time) => presentRange(scan, time)), nearest: nearestRay(scan) }))
