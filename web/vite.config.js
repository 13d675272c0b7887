import { defineConfig } from 'vite';

// Fixed names, so that a build without changes changes no file. Bundled code is plain text, so that it can stand in a
// C++ raw string.
export default defineConfig({
  base: '/',
  build: {
    chunkSizeWarningLimit: 2000,
    modulePreload: false,
    rollupOptions: { output: { entryFileNames: 'assets/page.js', assetFileNames: 'assets/page[extname]' } },
  },
});
