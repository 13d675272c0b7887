// Checks .glb and .fbx files of `doppel animate`: the validator of Khronos finds no error and no warning in a .glb, and
// three.js in a browser moves the vertices as `vertices.npy` beside the file says. An .fbx needs the faces of
// `animation.obj` (--format pc2), since three.js keeps only the corners of faces. Where `camera.json` lies beside the
// file, a camera that looks along -z with its principal point in the middle (tests/web/camera.json is one), the images
// of three.js with the texture and without light are compared with those of `--format png --camera camera.json
// --background #00ff00`.
//   node check_glb.mjs FILE ...        exit code 1: a file fails
import { existsSync, readFileSync } from 'node:fs';
import { dirname, extname, join } from 'node:path';
import { launch, open, serve } from './browser.mjs';
import { readNpy } from './npy.mjs';
import { kWebGl } from './page_checks.mjs';
import { validate } from './validate_glb.mjs';

const kFrames = 5, kMeanLimit = 2, kWorstLimit = 8;  // millimetres
const kCoverLimit = 0.99, kColourLimit = 4;  // IoU; mean difference of 0..255
const page_text = `<!doctype html><script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { FBXLoader } from 'three/addons/loaders/FBXLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
const loadGlb = async () => new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync('/file.glb');
const loadFbx = async () => {
  const manager = new THREE.LoadingManager();
  const complete = new Promise((done) => { manager.onLoad = done; });  // with the texture
  const group = await new FBXLoader(manager).loadAsync('/file.fbx');
  await complete;
  group.scale.setScalar(0.01 * group.userData.unitScaleFactor);  // the unit of FBX is the centimetre
  return { scene: new THREE.Group().add(group), animations: group.animations };
};
window.load = async (kind) => {
  const file = await (kind === '.fbx' ? loadFbx() : loadGlb());
  const mixer = new THREE.AnimationMixer(file.scene);
  const action = mixer.clipAction(file.animations[0]);
  action.setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  window.mesh = null;
  file.scene.traverse((node) => { if (node.isSkinnedMesh) window.mesh = node; });
  window.scene = file.scene;
  window.mixer = mixer;
  return { duration: file.animations[0].duration, textured: Boolean(window.mesh.material.map) };
};
window.pose = (seconds) => {
  window.mixer.setTime(seconds);
  window.scene.updateMatrixWorld(true);
  const { position, _vertex: index } = window.mesh.geometry.attributes, point = new THREE.Vector3(), found = [];
  for (let i = 0; i < position.count; ++i) {
    window.mesh.getVertexPosition(i, point).applyMatrix4(window.mesh.matrixWorld);
    found.push([index ? index.getX(i) : i, point.x, point.y, point.z]);
  }
  return found;
};
// Green where nothing is, from the top down.
window.picture = ({ width, height, K, t }) => {
  const camera = new THREE.PerspectiveCamera((360 / Math.PI) * Math.atan(height / 2 / K[4]), width / height, 0.1, 100);
  camera.position.set(-t[0], t[1], t[2]);  // it looks along -z
  window.renderer ??= new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
  window.renderer.setPixelRatio(4);  // the pictures of doppel animate have smooth edges as well
  window.renderer.setSize(width, height);
  window.mesh.material = new THREE.MeshBasicMaterial({ map: window.mesh.material.map });
  window.mesh.frustumCulled = false;
  const world = new THREE.Scene();
  world.background = new THREE.Color(0x00ff00);
  world.add(window.scene);
  window.renderer.render(world, camera);
  return window.renderer.domElement;
};
const bytes = (image, { width, height }) => {
  const canvas = new OffscreenCanvas(width, height), context = canvas.getContext('2d');
  context.imageSmoothingQuality = 'high';
  context.drawImage(image, 0, 0, width, height);
  return context.getImageData(0, 0, width, height).data;
};
window.difference = async (view, url) => {
  const image = new Image();
  image.src = url;
  await image.decode();
  const ours = bytes(image, view), theirs = bytes(window.picture(view), view);
  let both = 0, either = 0, sum = 0;
  const person = (pixels, at) => pixels[at + 1] - Math.max(pixels[at], pixels[at + 2]) < 128;
  for (let at = 0; at < ours.length; at += 4) {
    const here = person(ours, at), there = person(theirs, at);
    either += here || there;
    if (!here || !there) continue;
    ++both;
    for (let k = 0; k < 3; ++k) sum += Math.abs(ours[at + k] - theirs[at + k]) / 3;
  }
  return { cover: both / either, colour: sum / both };
};
window.ready = true;
</script>`;

// The vertex of each corner of the faces of an .obj file.
const corners = (path) => readFileSync(path, 'utf8').split('\n').filter((line) => line.startsWith('f '))
  .flatMap((line) => line.trim().split(/\s+/).slice(1).map((corner) => parseInt(corner) - 1));

async function compare(browser, path) {
  const kind = extname(path), vertex = kind === '.fbx' ? corners(join(dirname(path), 'animation.obj')) : null;
  const truth = readNpy(join(dirname(path), 'vertices.npy')), [frames, vertices] = truth.shape;
  const camera_file = join(dirname(path), 'camera.json');
  const camera = existsSync(camera_file) ? JSON.parse(readFileSync(camera_file)).cam0 : null;
  const picture = (frame) => `camera_0_${String(frame).padStart(6, '0')}.png`;
  const server = await serve(page_text, (url) => (url === `/file${kind}` ? path : join(dirname(path), url)));
  const { page, complaints } = await open(browser, server);
  await page.waitForFunction(() => window.ready);
  const { duration, textured } = await page.evaluate((k) => window.load(k), kind);
  let sum = 0, count = 0, worst = 0, cover = 1, colour = 0;
  for (let i = 0; i < kFrames; ++i) {
    const frame = Math.round((i * (frames - 1)) / (kFrames - 1));
    for (const [v, x, y, z] of await page.evaluate((s) => window.pose(s), (duration * frame) / (frames - 1))) {
      const at = 3 * (frame * vertices + (vertex ? vertex[v] : v));
      const off = 1000 * Math.hypot(x - truth.values[at], y - truth.values[at + 1], z - truth.values[at + 2]);
      sum += off, count += 1, worst = Math.max(worst, off);
    }
    if (!camera) continue;
    const found = await page.evaluate(([view, url]) => window.difference(view, url), [camera, picture(frame)]);
    cover = Math.min(cover, found.cover), colour = Math.max(colour, found.colour);
  }
  await page.close();
  server.close();
  console.log(`${path}: three.js is ${(sum / count).toFixed(3)} mm off on average, ${worst.toFixed(2)} mm at most` +
    `${textured ? '' : ', no texture'}`);
  if (camera)
    console.log(`${path}: pictures cover each other with an IoU of ${cover.toFixed(4)}, colours differ by ${colour.toFixed(2)} of 255`);
  complaints.forEach((text) => console.error(text));
  return complaints.length === 0 && sum / count <= kMeanLimit && worst <= kWorstLimit && cover >= kCoverLimit && colour <= kColourLimit;
}

const browser = await launch(...kWebGl);
let good = true;
for (const path of process.argv.slice(2)) {
  if (extname(path) === '.glb') good = (await validate(path)) && good;
  good = (await compare(browser, path)) && good;
}
await browser.close();
process.exit(good ? 0 : 1);
