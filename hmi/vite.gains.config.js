import { defineConfig } from 'vite';
import { withLicence } from './vite.licence.js';

// The gains that a reader of the documentation drags: a script and its style, beside what `tools/build_wasm.py` writes.
// None of it is committed.
export default defineConfig({
  plugins: [withLicence()],
  publicDir: false,
  build: {
    outDir: '../build/wasm/site',
    emptyOutDir: true,
    target: 'es2022',
    lib: {
      entry: 'src/gains/main.ts',
      formats: ['iife'],
      name: 'gains',
      fileName: () => 'gains.js',
      cssFileName: 'gains',
    },
  },
});
