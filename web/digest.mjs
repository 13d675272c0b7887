// The digest of the page's sources.   node digest.mjs: checks dist/sources.txt, exit code 1 when it is another
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));

export function digest() {
  const hash = createHash('sha256');
  const sources = readdirSync(join(here, 'src')).sort().map((name) => join('src', name));
  for (const name of ['index.html', 'package-lock.json', 'vite.config.js', ...sources]) hash.update(name).update(readFileSync(join(here, name)));
  return hash.digest('hex');
}

if (process.argv[1] === fileURLToPath(import.meta.url) && readFileSync(join(here, 'dist/sources.txt'), 'utf8').trim() !== digest()) {
  console.error('web/dist was built from other sources; run `npm ci && npm run build` in web/');
  process.exit(1);
}
