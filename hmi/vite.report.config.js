import { defineConfig } from 'vite';
import { withLicence } from './vite.licence.js';

// The viewer of the reports: one script and one style sheet, which every report carries inside itself.
export default defineConfig({
  plugins: [withLicence()],
  publicDir: false,
  build: {
    outDir: '../src/gantryctl/engineering/report/viewer',
    emptyOutDir: true,
    target: 'es2022',
    lib: {
      entry: 'src/report/main.ts',
      formats: ['iife'],
      name: 'viewer',
      fileName: () => 'viewer.js',
      cssFileName: 'viewer',
    },
  },
});
