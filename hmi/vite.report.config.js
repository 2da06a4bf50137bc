import { readFileSync } from 'node:fs';
import { defineConfig } from 'vite';

// The viewer of the reports: one script and one style sheet, which every report carries inside itself.
const licence = readFileSync('node_modules/uplot/LICENSE', 'utf-8').trim();
const { version } = JSON.parse(readFileSync('node_modules/uplot/package.json', 'utf-8'));

/** The licence of uPlot wants to go with every copy; a minifier would drop it. */
function withLicence() {
  const notice = `/* Contains uPlot ${version}.\n${licence} */\n`;
  return {
    name: 'with-licence',
    enforce: 'post',
    generateBundle(_, bundle) {
      for (const made of Object.values(bundle)) if (made.type === 'chunk') made.code = notice + made.code;
    },
  };
}

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
