// Checks .glb files of `doppel animate`: the validator of Khronos finds no error and no warning, and three.js in a
// browser moves the vertices as `vertices.npy` beside the file says.
//   node check_glb.mjs FILE.glb ...        exit code 1: a file fails
import { createServer } from 'node:http';
import { readFileSync, existsSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import validator from 'gltf-validator';
import { chromium } from 'playwright-core';

const kFrames = 5, kMeanLimit = 2, kWorstLimit = 8;  // millimetres
const here = dirname(fileURLToPath(import.meta.url));
const page_text = `<!doctype html><script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
window.load = async () => {
  const gltf = await new GLTFLoader().loadAsync('/file.glb');
  const mixer = new THREE.AnimationMixer(gltf.scene);
  const action = mixer.clipAction(gltf.animations[0]);
  action.setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  window.mesh = null;
  gltf.scene.traverse((node) => { if (node.isSkinnedMesh) window.mesh = node; });
  window.scene = gltf.scene;
  window.mixer = mixer;
  return { duration: gltf.animations[0].duration, textured: Boolean(window.mesh.material.map) };
};
window.pose = (seconds) => {
  window.mixer.setTime(seconds);
  window.scene.updateMatrixWorld(true);
  const index = window.mesh.geometry.getAttribute('_vertex'), point = new THREE.Vector3(), found = [];
  for (let i = 0; i < index.count; ++i) {
    window.mesh.getVertexPosition(i, point).applyMatrix4(window.mesh.matrixWorld);
    found.push([index.getX(i), point.x, point.y, point.z]);
  }
  return found;
};
window.ready = true;
</script>`;

// [frames, vertices, 3] float32 of a .npy file of version 1.
function readNpy(path) {
  const bytes = readFileSync(path), size = bytes.readUInt16LE(8);
  const shape = /'shape': \(([^)]*)\)/.exec(bytes.toString('latin1', 10, 10 + size))[1].split(',').map(Number);
  return { shape, at: (i) => bytes.readFloatLE(10 + size + 4 * i) };
}

async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { uri: path });
  const { numErrors, numWarnings, messages } = report.issues;
  for (const message of messages.filter((m) => m.severity < 2)) console.error(`${path}: ${message.code}: ${message.message} ${message.pointer}`);
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings`);
  return numErrors + numWarnings === 0;
}

function serve(file) {
  const server = createServer((request, response) => {
    const url = request.url.split('?')[0];
    const module = url.startsWith('/modules/') ? join(here, 'node_modules', url.slice(9)) : '';
    if (url === '/') response.setHeader('Content-Type', 'text/html').end(page_text);
    else if (url === '/file.glb') response.end(readFileSync(file));
    else if (module && existsSync(module)) response.setHeader('Content-Type', 'text/javascript').end(readFileSync(module));
    else response.writeHead(url === '/favicon.ico' ? 204 : 404).end();
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

async function compare(browser, path) {
  const truth = readNpy(join(dirname(path), 'vertices.npy')), [frames, vertices] = truth.shape;
  const server = await serve(path), page = await browser.newPage();
  const complaints = [];
  page.on('console', (message) => { if (message.type() === 'error') complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(String(error)));
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction(() => window.ready);
  const { duration, textured } = await page.evaluate(() => window.load());
  let sum = 0, count = 0, worst = 0;
  for (let i = 0; i < kFrames; ++i) {
    const frame = Math.round((i * (frames - 1)) / (kFrames - 1));
    for (const [v, x, y, z] of await page.evaluate((s) => window.pose(s), (duration * frame) / (frames - 1))) {
      const at = 3 * (frame * vertices + v);
      const off = 1000 * Math.hypot(x - truth.at(at), y - truth.at(at + 1), z - truth.at(at + 2));
      sum += off, count += 1, worst = Math.max(worst, off);
    }
  }
  await page.close();
  server.close();
  console.log(`${path}: three.js is ${(sum / count).toFixed(3)} mm off on average, ${worst.toFixed(2)} mm at most` +
    `${textured ? '' : ', no texture'}`);
  complaints.forEach((text) => console.error(text));
  return complaints.length === 0 && sum / count <= kMeanLimit && worst <= kWorstLimit;
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync'],
});
let good = true;
for (const path of process.argv.slice(2)) {
  good = (await validate(path)) && good;
  good = (await compare(browser, path)) && good;
}
await browser.close();
process.exit(good ? 0 : 1);
