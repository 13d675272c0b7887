// Checks a file of `doppel animate --format engine-glb --tolerance 0` of 25 frames a second: the validator of Khronos
// finds no error and no warning, and in a browser examples/play_engine_clip.mjs gives the vertices that the weights in
// the animations give, which the program computed. They are compared in each frame. The last animation, which must have
// no cut, is also compared at another frame rate.
//   node check_engine.mjs FILE.glb        exit code 1: it fails
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { launch, open, serve } from './browser.mjs';
import { validate } from './validate_glb.mjs';

const kExample = join(dirname(fileURLToPath(import.meta.url)), '../../examples/play_engine_clip.mjs');
const kRate = 25, kOtherRate = 61;  // frames a second: of the clip, and of an engine
const kMeanLimit = 0.05, kWorstLimit = 1;  // millimetres, at the rate of the clip
const kOtherLimit = 0.05;  // between the frames, where weights in the file are linear: of what the shapes move
const page_text = `<!doctype html><script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { Correctives } from '/play_engine_clip.mjs';
const gltf = await new GLTFLoader().loadAsync('/engine.glb'), correctives = await Correctives.of(gltf);
const mesh = correctives.mesh, weights = mesh.morphTargetInfluences;
const positions = () => {
  const points = [];
  for (let i = 0; i < mesh.geometry.attributes.position.count; i += 3)
    points.push(mesh.getVertexPosition(i, new THREE.Vector3()).clone());
  return points;
};
// Plays an animation: the distance of the vertices from those of its weights, and how much the weights move them.
window.play = (number, rate) => {
  const clip = gltf.animations[number], mixer = new THREE.AnimationMixer(gltf.scene);
  const action = mixer.clipAction(clip);
  action.setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  correctives.reset();
  let sum = 0, worst = 0, moved = 0, count = 0;
  for (let frame = 0; frame / rate <= clip.duration + 1e-6; ++frame) {
    mixer.setTime(frame / rate);
    gltf.scene.updateMatrixWorld(true);
    const expected = positions(), stored = [...weights];
    correctives.update(frame === 0 ? 0 : 1 / rate);
    const found = positions();
    weights.fill(0);
    const without = positions();
    stored.forEach((weight, k) => { weights[k] = weight; });
    expected.forEach((point, i) => {
      const off = 1000 * point.distanceTo(found[i]);
      sum += off, worst = Math.max(worst, off), moved += 1000 * point.distanceTo(without[i]), count += 1;
    });
  }
  mixer.stopAllAction();
  return { mean: sum / count, worst, moved: moved / count };
};
window.animations = gltf.animations.length;
</script>`;

const path = process.argv[2];
const browser = await launch();
const server = await serve(page_text, (url) => (url === '/engine.glb' ? path : url === '/play_engine_clip.mjs' ? kExample : null));
let good = await validate(path);
const { page, complaints } = await open(browser, server);
await page.waitForFunction(() => window.animations);
const play = (number, rate) => page.evaluate(([n, r]) => window.play(n, r), [number, rate]);
const animations = await page.evaluate(() => window.animations);
let last = null;
for (let i = 0; i < animations; ++i) {
  last = await play(i, kRate);
  console.log(`animation ${i}: correctives move vertices by ${last.moved.toFixed(2)} mm on average; the example is ` +
    `${last.mean.toFixed(4)} mm off on average, ${last.worst.toFixed(3)} mm at most`);
  good = good && last.moved > 1 && last.mean < kMeanLimit && last.worst < kWorstLimit;
}
const other = await play(animations - 1, kOtherRate);
console.log(`the last with ${kOtherRate} frames a second: ${other.mean.toFixed(3)} mm off on average`);
good = good && other.mean < kOtherLimit * last.moved;
complaints.forEach((text) => console.error(text));
await browser.close();
server.close();
process.exit(good && complaints.length === 0 ? 0 : 1);
