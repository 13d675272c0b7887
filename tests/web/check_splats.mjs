// Checks the Gaussians of the viewer's page (web/src/splats.js) in a browser: all pixels against the definition of
// `draw_splats` (docs/layers/splats.md), which stands here in double precision.
//   node check_splats.mjs        exit code 1: a pixel is off
import assert from 'node:assert/strict';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { launch, open, serve } from './browser.mjs';
import { kWebGl } from './page_checks.mjs';

const kSources = join(dirname(fileURLToPath(import.meta.url)), '../../web/src');
const kWidth = 240, kHeight = 180, kFov = 40, kBack = [20, 40, 60];  // device pixels; degrees; of 255
const kLimit = 3;  // of 255: the canvas rounds after each Gaussian

const page_text = `<!doctype html><script type="importmap">{"imports": {"three": "/modules/three/build/three.module.js"}}</script>
<script type="module">
import { Color, Mesh, MeshBasicMaterial, PerspectiveCamera, PlaneGeometry, Scene, SRGBColorSpace, WebGLRenderer } from 'three';
import { Splats } from '/src/splats.js';
const renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setPixelRatio(2);
renderer.setSize(${kWidth / 2}, ${kHeight / 2});
const colour = (rgb) => new Color().setRGB(...rgb.map((c) => c / 255), SRGBColorSpace);
// RGBA from the bottom up. @param views cameras, one after the other; the last image counts  @param plane { z, rgb }
window.drawn = ({ rows, views, opacity, shift, plane }) => {
  const splats = new Splats(rows.length / 14), scene = new Scene();
  splats.show({ vertices: new Float32Array(3), gaussians: Float32Array.from(rows) });
  splats.mesh.position.x = shift;
  splats.fade(opacity);
  scene.background = colour(${JSON.stringify(kBack)});
  scene.add(splats.mesh);
  if (plane) {
    const mesh = new Mesh(new PlaneGeometry(9, 9), new MeshBasicMaterial({ color: colour(plane.rgb) }));
    mesh.position.z = plane.z;
    scene.add(mesh);
  }
  scene.onBeforeRender = (_, __, camera) => splats.prepare(renderer, camera);
  for (const { eye, target } of views) {
    const camera = new PerspectiveCamera(${kFov}, ${kWidth / kHeight}, 0.05, 100);
    camera.position.fromArray(eye);
    camera.lookAt(...target);
    renderer.render(scene, camera);
  }
  const gl = renderer.getContext(), pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return Array.from(pixels);
};
window.ready = true;
</script>`;

const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((v) => v / Math.hypot(...a));

// Rows [4] of the projection to pixels from the top left.
function projectionOf({ eye, target }) {
  const back = unit(eye.map((v, i) => v - target[i])), right = unit(cross([0, 1, 0], back)), up = cross(back, right);
  const focal = kHeight / 2 / Math.tan((kFov * Math.PI) / 360), depth = back.map((v) => -v);
  const left = [right.map((v, i) => focal * v + (kWidth / 2) * depth[i]), up.map((v, i) => (kHeight / 2) * depth[i] - focal * v), depth];
  return left.map((row) => [...row, -dot(row, eye)]);
}

// The Gaussian of a row [14] on the screen.
function projected(row, matrix, eye) {
  const p = row.slice(0, 3), [w, x, y, z] = row.slice(3, 7), seen = matrix.map((m) => dot(m, [...p, 1]));
  const turn = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]];
  const centre = [seen[0] / seen[2], seen[1] / seen[2]];
  const limited = [kWidth, kHeight].map((size, r) => Math.min(1.15 * size, Math.max(-0.15 * size, centre[r])));
  const along = [0, 1].map((r) => {
    const j = [0, 1, 2].map((k) => (matrix[r][k] - limited[r] * matrix[2][k]) / seen[2]);
    return [0, 1, 2].map((k) => row[7 + k] * dot(j, turn.map((line) => line[k])));
  });
  const xx = dot(along[0], along[0]) + 0.3, yy = dot(along[1], along[1]) + 0.3, xy = dot(along[0], along[1]), det = xx * yy - xy * xy;
  return { distance: Math.hypot(...p.map((v, i) => v - eye[i])), visible: seen[2] > 0.05, colour: row.slice(11), alpha: (u, v) => {
    const dx = u - centre[0], dy = v - centre[1];
    const alpha = Math.min(0.99, row[10] * Math.exp(-0.5 * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / det));
    return alpha < 1 / 255 ? 0 : alpha;
  } };
}

// The image by the definition, over the background: function of a pixel -> RGB of 255.
function expectedImage({ rows, views, opacity, shift }) {
  const { eye } = views.at(-1), matrix = projectionOf(views.at(-1)), gaussians = [];
  for (let at = 0; at < rows.length; at += 14) gaussians.push(projected([rows[at] + shift, ...rows.slice(at + 1, at + 14)], matrix, eye));
  const nearest = gaussians.filter(({ visible }) => visible).sort((a, b) => a.distance - b.distance);
  return (u, v) => {
    let left = 1;
    const rgb = [0, 0, 0];
    for (const { alpha, colour } of nearest) {
      const weight = left < 1e-4 ? 0 : left * alpha(u + 0.5, v + 0.5);
      rgb.forEach((_, k) => { rgb[k] += 255 * weight * colour[k]; });
      left -= weight;
    }
    return rgb.map((c, k) => opacity * (c + left * kBack[k]) + (1 - opacity) * kBack[k]);
  };
}

const kFront = { eye: [0, 0, 2], target: [0, 0, 0] };
const given = (scene) => ({ views: [kFront], opacity: 1, shift: 0, ...scene, rows: scene.rows.flat() });

const browser = await launch(...kWebGl), server = await serve(page_text, (url) => join(kSources, url.replace('/src/', '')));
let code = 0;
try {
  const { page, complaints } = await open(browser, server);
  await page.waitForFunction(() => window.ready);
  const drawn = async (scene) => {
    const pixels = await page.evaluate((what) => window.drawn(what), given(scene));
    return (u, v) => pixels.slice(4 * ((kHeight - 1 - v) * kWidth + u), 4 * ((kHeight - 1 - v) * kWidth + u) + 3);
  };
  const near = (found, expected, limit, what) => found.forEach((c, k) =>
    assert.ok(Math.abs(c - expected[k]) <= limit, `${what}: [${found}] instead of [${expected.map((e) => e.toFixed(1))}]`));
  const check = async (what, scene) => {
    const found = await drawn(scene), expected = expectedImage(given(scene));
    let covered = 0;
    for (let v = 0; v < kHeight; ++v)
      for (let u = 0; u < kWidth; ++u) {
        near(found(u, v), expected(u, v), kLimit, `${what}, pixel ${u} ${v}`);
        covered += expected(u, v).some((c, k) => Math.abs(c - kBack[k]) > 2);
      }
    assert.ok(covered > 50, `${what}: ${covered} pixels are covered`);
    console.log(`${what}: ${covered} pixels as defined`);
  };
  const centre = async (what, scene, expected) => near((await drawn(scene))(kWidth / 2, kHeight / 2), expected, 2, what);

  // x y z, quaternion w x y z, deviations, opacity, RGB
  const round = (z, deviation, opacity, rgb) => [0, 0, z, 1, 0, 0, 0, deviation, deviation, deviation, opacity, ...rgb];
  const half = [0.5, 0.5, 0.5, 0.5], tilted = unit([0.8, 0.3, -0.4, 0.2]);
  const wall = [];
  for (let i = -20; i < 20; ++i) for (let j = -20; j < 20; ++j) wall.push([0.03 * i, 0.03 * j, 0, ...half, 0.02, 0.001, 0.02, 0.95, 0.8, 0.3, 0.15]);
  const of_wall = [204, 76.5, 38.25], blue = round(0.5, 0.2, 0.5, [0, 0, 1]);
  await centre('a wall', { rows: wall }, of_wall);
  await centre('a wall behind half a blue Gaussian', { rows: [...wall, blue] }, [102, 38.25, 146.6]);
  await centre('a wall before half a blue Gaussian', { rows: [...wall, blue], views: [kFront, { eye: [0, 0, -2], target: [0, 0, 0] }] }, of_wall);
  await centre('half a wall', { rows: wall, opacity: 0.5 }, of_wall.map((c, k) => (c + kBack[k]) / 2));
  await centre('a wall behind a plane', { rows: wall, plane: { z: 0.5, rgb: [9, 99, 199] } }, [9, 99, 199]);
  await centre('a wall before a plane', { rows: wall, plane: { z: -0.5, rgb: [9, 99, 199] } }, of_wall);

  await check('a tilted Gaussian', { rows: [[0.1, -0.05, 0.2, ...tilted, 0.2, 0.004, 0.05, 0.9, 0.9, 0.6, 0.1]] });
  await check('an opaque needle', { rows: [[0.3, 0.1, 0, ...unit([0.9, 0, 0, 0.4]), 0.4, 0.0005, 0.0005, 1, 1, 1, 1]] });
  await check('a Gaussian beside', { rows: [[0, 0, 0.1, ...tilted, 0.1, 0.02, 0.05, 0.9, 0.2, 0.6, 0.9]], shift: 0.3 });
  await check('a large one outside the image', { rows: [[1.6, 0.2, 0.6, ...tilted, 0.5, 0.3, 0.4, 0.95, 0.9, 0.1, 0.5]] });

  let seed = 1;
  const random = () => { seed = (seed * 16807) % 2147483647; return seed / 2147483647; };
  const crowd = Array.from({ length: 300 }, () => [2 * random() - 1, 1.4 * random() - 0.7, 2 * random() - 1,
    ...unit([random() - 0.5, random() - 0.5, random() - 0.5, random() - 0.5]), 0.1 * random(), 0.1 * random(), 0.02 * random(), random() ** 2,
    random(), random(), random()]);
  const above = { eye: [0.5, 1.2, 1.6], target: [0.1, 0, 0] };
  await check('a crowd', { rows: crowd, views: [kFront, above] });
  await check('half a crowd', { rows: crowd, views: [above], opacity: 0.6 });

  // A number that is not finite, no opacity, and a Gaussian behind the camera: as without them.
  const strange = [round(0, 0.1, NaN, [1, 1, 1]), round(NaN, 0.1, 1, [1, 1, 1]), round(Infinity, 0.1, 1, [1, 1, 1]),
    round(0, 0.1, 0.003, [1, 1, 1]), round(2.5, 0.1, 1, [1, 1, 1])];
  const pixels = await drawn({ rows: [...strange, ...crowd] }), without = await drawn({ rows: crowd });
  for (let v = 0; v < kHeight; ++v) for (let u = 0; u < kWidth; ++u) assert.deepEqual(pixels(u, v), without(u, v));
  assert.deepEqual(complaints, []);
} catch (error) {
  console.error(error.message);
  code = 1;
}
await browser.close();
server.close();
process.exit(code);
