import { svelte, vitePreprocess } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vite';

// The built page is package data: committed, and the same bytes wherever it is built.
export default defineConfig({
  plugins: [svelte({ preprocess: vitePreprocess({ script: false }) })],
  build: {
    outDir: '../src/gantryctl/gateway/page',
    emptyOutDir: true,
    target: 'es2022',
    assetsInlineLimit: 0, // the content policy allows nothing inline
    modulePreload: { polyfill: false },
  },
});
