import { defineConfig } from 'vite';
import { digest } from './digest.mjs';

// Fixed names, so that a build without changes changes no file. Bundled code is plain text, so that it can stand in a
// C++ raw string.
export default defineConfig({
  base: './',
  plugins: [{
    name: 'digest',
    generateBundle() { this.emitFile({ type: 'asset', fileName: 'sources.txt', source: `${digest()}\n` }); },
  }],
  build: {
    chunkSizeWarningLimit: 2000,
    modulePreload: false,
    rollupOptions: { output: { entryFileNames: 'assets/page.js', assetFileNames: 'assets/page[extname]' } },
  },
});
