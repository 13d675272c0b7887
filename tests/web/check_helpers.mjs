// Checks a file of `doppel animate --format npy,engine-glb --helpers N` of one motion of 25 frames a second: the
// validator of Khronos finds no error and no warning, and in a browser the vertices are as far from those of
// vertices.npy, in the last fifth of the motion, as the program says: with the keys of the helpers by skinning alone,
// and with the helpers of examples/play_engine_clip.mjs.
//   node check_helpers.mjs FILE.glb VERTICES.npy REPORT.json        exit code 1: it fails
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { launch, open, serve } from './browser.mjs';
import { readNpy } from './npy.mjs';
import { validate } from './validate_glb.mjs';

const kExample = join(dirname(fileURLToPath(import.meta.url)), '../../examples/play_engine_clip.mjs');
const kRate = 25, kFittedShare = 0.8;
const kLimit = 0.02;  // millimetres between the distances that are stated and those that are found
const page_text = `<!doctype html><script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { Helpers } from '/play_engine_clip.mjs';
const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync('/engine.glb');
const helpers = await Helpers.of(gltf), mesh = helpers.mesh, index = mesh.geometry.attributes._vertex;
const mixer = new THREE.AnimationMixer(gltf.scene), action = mixer.clipAction(gltf.animations[0]);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();
const positions = () => {
  const rows = {};
  for (let i = 0; i < index.count; ++i) rows[index.getX(i)] = mesh.getVertexPosition(i, new THREE.Vector3()).toArray();
  return rows;
};
// A frame: the vertices by the keys of the file, and by the example.
window.frame = (number, rate) => {
  mixer.setTime(number / rate);
  gltf.scene.updateMatrixWorld(true);
  const keys = positions();
  helpers.update(number === 0 ? 0 : 1 / rate);
  return { keys, example: positions() };
};
</script>`;

const [path, npy, report] = process.argv.slice(2);
const { shape, values } = readNpy(npy), clip = JSON.parse(readFileSync(report)).engine_glb.clips[0];
const mean_distance = (rows, frame) => {
  let sum = 0;
  for (const [vertex, row] of Object.entries(rows))
    sum += 1000 * Math.hypot(...row.map((value, k) => value - values[3 * (frame * shape[1] + Number(vertex)) + k]));
  return sum / Object.keys(rows).length;
};
const browser = await launch();
const server = await serve(page_text, (url) => (url === '/engine.glb' ? path : url === '/play_engine_clip.mjs' ? kExample : null));
let good = await validate(path);
const { page, complaints } = await open(browser, server);
await page.waitForFunction(() => window.frame);
const first = Math.floor(kFittedShare * shape[0]), found = { keys: 0, example: 0 };
for (let frame = 0; frame < shape[0]; ++frame) {
  const rows = await page.evaluate(([n, r]) => window.frame(n, r), [frame, kRate]);
  if (frame < first) continue;
  for (const kind of ['keys', 'example']) found[kind] += mean_distance(rows[kind], frame) / (shape[0] - first);
}
for (const [kind, stated] of [['keys', clip.keys_mm], ['example', clip.helpers_mm]]) {
  console.log(`${kind}: vertices off by ${found[kind].toFixed(3)} mm on average; the program says ${stated.toFixed(3)} mm, ` +
    `and ${clip.skinning_mm.toFixed(3)} mm of skinning`);
  good = good && Math.abs(found[kind] - stated) < kLimit && stated < 0.8 * clip.skinning_mm;
}
complaints.forEach((text) => console.error(text));
await browser.close();
server.close();
process.exit(good && complaints.length === 0 ? 0 : 1);
