import { svelte, vitePreprocess } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vitest/config';

// Parts of the page by themselves; the whole page is tested in a browser (tests/system/page).
export default defineConfig({
  plugins: [svelte({ preprocess: vitePreprocess({ script: false }) })],
  resolve: { conditions: ['browser'] }, // the Svelte that mounts, not the one that renders on a server
  test: { environment: 'happy-dom', include: ['tests/**/*.test.ts'], setupFiles: ['tests/setup.ts'] },
});
