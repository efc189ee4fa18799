// Unit tests of the page: in Node with a simulated DOM, without a browser or a simulator.
import { defineConfig } from 'vitest/config'

export default defineConfig({
  server: { fs: { allow: ['..'] } }, // shaders that the page shares with the simulator
  test: {
    testTimeout: 180_000, // a busy machine is slow
    environment: 'happy-dom',
    environmentOptions: { happyDOM: { url: 'http://simulator.test:8730/lab/?token=secret' } },
    globalSetup: 'tests/hud_frames.ts',
    include: ['tests/**/*.test.ts'],
    restoreMocks: true,
    unstubGlobals: true,
    isolate: false,
    fileParallelism: false,
  },
})
