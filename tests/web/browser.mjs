import { createServer } from 'node:http';
import { existsSync, readFileSync } from 'node:fs';
import { dirname, extname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

const here = dirname(fileURLToPath(import.meta.url));
const kTypes = { '.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript', '.mjs': 'text/javascript', '.wasm': 'application/wasm' };

export const launch = (...extra) => chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync', ...extra],
});

// Serves `page` at /, npm packages below /modules/, and what `file` gives for other paths: the path of a file, or nothing.
export function serve(page, file) {
  const server = createServer((request, response) => {
    const url = request.url.split('?')[0];
    const found = url.startsWith('/modules/') ? join(here, 'node_modules', url.slice(9)) : file(url);
    if (url === '/') response.setHeader('Content-Type', 'text/html').end(page);
    else if (found && existsSync(found)) {
      response.setHeader('Content-Type', kTypes[extname(found)] ?? 'application/octet-stream').end(readFileSync(found));
    } else response.writeHead(url === '/favicon.ico' ? 204 : 404).end();
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

// A page of the server, and what its console complains about.
export async function open(browser, server) {
  const page = await browser.newPage(), complaints = [];
  page.on('console', (message) => { if (message.type() === 'error') complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(String(error)));
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  return { page, complaints };
}
