// Runs tests/support/hud_frames.py once: Frames as the simulator encodes them, and the HUD texts that Python expects.
import { execFileSync } from 'node:child_process'
import { existsSync } from 'node:fs'
import { fileURLToPath } from 'node:url'
import type { TestProject } from 'vitest/node'

const ROOT = fileURLToPath(new URL('../..', import.meta.url))
const PYTHON = `${ROOT}.venv/bin/python`

/** A Frame in MessagePack (base64), and what the page must derive from it. */
export interface HudFrame {
  name: string
  frame: string
  rows: Record<string, string>
  /** Range of the turning beam at quarters of a scan [m]; null: no return. */
  beam: (number | null)[]
  nearest: number
}

export default function setup(project: TestProject): void {
  if (!existsSync(PYTHON)) throw new Error(`${PYTHON} is missing. Run scripts/setup --dev first.`)
  const output = execFileSync(PYTHON, ['-m', 'tests.support.hud_frames'], { cwd: ROOT, maxBuffer: 2 ** 26 })
  project.provide('hudFrames', JSON.parse(output.toString()) as HudFrame[])
}

declare module 'vitest' {
  interface ProvidedContext {
    hudFrames: HudFrame[]
  }
}
