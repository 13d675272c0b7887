// Checks .glb files of `doppel animate`: the validator of Khronos finds no error and no warning, and three.js in a
// browser moves the vertices as `vertices.npy` beside the file says.
//   node check_glb.mjs FILE.glb ...        exit code 1: a file fails
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import validator from 'gltf-validator';
import { launch, open, serve } from './browser.mjs';
import { readNpy } from './npy.mjs';

const kFrames = 5, kMeanLimit = 2, kWorstLimit = 8;  // millimetres
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

async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { uri: path });
  const { numErrors, numWarnings, messages } = report.issues;
  for (const message of messages.filter((m) => m.severity < 2)) console.error(`${path}: ${message.code}: ${message.message} ${message.pointer}`);
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings`);
  return numErrors + numWarnings === 0;
}

async function compare(browser, path) {
  const truth = readNpy(join(dirname(path), 'vertices.npy')), [frames, vertices] = truth.shape;
  const server = await serve(page_text, (url) => (url === '/file.glb' ? path : ''));
  const { page, complaints } = await open(browser, server);
  await page.waitForFunction(() => window.ready);
  const { duration, textured } = await page.evaluate(() => window.load());
  let sum = 0, count = 0, worst = 0;
  for (let i = 0; i < kFrames; ++i) {
    const frame = Math.round((i * (frames - 1)) / (kFrames - 1));
    for (const [v, x, y, z] of await page.evaluate((s) => window.pose(s), (duration * frame) / (frames - 1))) {
      const at = 3 * (frame * vertices + v);
      const off = 1000 * Math.hypot(x - truth.values[at], y - truth.values[at + 1], z - truth.values[at + 2]);
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

const browser = await launch();
let good = true;
for (const path of process.argv.slice(2)) {
  good = (await validate(path)) && good;
  good = (await compare(browser, path)) && good;
}
await browser.close();
process.exit(good ? 0 : 1);
