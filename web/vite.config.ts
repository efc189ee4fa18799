// How the page is built: all URLs relative, so that it works behind any proxy.
import { defineConfig } from 'vite'

export default defineConfig({
  base: './',
  build: { outDir: '../src/autodrive/page', emptyOutDir: true, target: 'es2022', chunkSizeWarningLimit: 1500 },
  server: {
    fs: { allow: ['..'] },
    proxy: { '/ws': { target: 'ws://127.0.0.1:8730', ws: true }, '/scene': 'http://127.0.0.1:8730' },
  },
})
