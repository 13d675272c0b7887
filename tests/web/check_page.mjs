// Checks the page that `doppel export --format web` writes against the page of `doppel view` of the same double.
//   node check_page.mjs FOLDER [URL]
// A plain file server serves FOLDER. The double plays, follows a slider, and a joint follows the mouse; the picture covers
// the pixels of the projected mesh; Gaussians follow the camera and fade. With URL, the address of the server: every stage
// has the same vertices to 1e-5 m, the same texels to one step of 255, the same Gaussians (kGaussianLimit) and the same
// picture, and the page of the server follows live poses. Exit code 1: one of these fails.
import assert from 'node:assert/strict';
import { launch, serve } from './browser.mjs';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { checkGaussians, checkLive, checkPhone, checkPlaying, checkReach, checkSlider, kWebGl, openPage } from './page_checks.mjs';

const kViewport = { width: 960, height: 540 };
const kGaussianLimit = 1e-3;  // of colours and opacities 0..1; a tenth of it in metres
const [folder, url] = process.argv.slice(2);

// The stage `name` at a frame, from one camera: vertices, texels, and the picture's RGBA bytes from the bottom up.
const shown = async (page, name, frame) => {
  const found = await page.evaluate(pictureOf, { name, frame });
  const bytes = (text) => text && Buffer.from(text, 'base64');
  return { ...found, pixels: bytes(found.pixels), texels: bytes(found.texels) };
};

// Runs in the page; bytes are in base64, since lists of numbers are slow to hand over.
async function pictureOf({ name, frame }) {
  const { state, picture, goTo } = window.doppel;
  document.getElementById('handles').checked = picture.handles.visible = picture.grid.visible = false;
  [...document.getElementById('stages').children].find((button) => button.textContent === name).click();
  goTo(frame);
  while (!window.doppel.idle()) await new Promise((done) => { setTimeout(done, 20); });
  const { renderer, scene, camera } = picture, gl = renderer.getContext();
  renderer.render(scene, camera);
  const size = { width: gl.drawingBufferWidth, height: gl.drawingBufferHeight }, pixels = new Uint8Array(4 * size.width * size.height);
  gl.readPixels(0, 0, size.width, size.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const base64 = (bytes) => {
    let text = '';
    for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    return btoa(text);
  };
  return { ...size, pixels: base64(pixels), projection: picture.projection(), corners: Array.from(picture.source.mesh.corners,
    (corner) => picture.source.mesh.source[corner]), vertices: Array.from(state.geometry.vertices),
  texels: state.geometry.texels && base64(state.geometry.texels), gaussians: state.geometry.gaussians && Array.from(state.geometry.gaussians) };
}

const farthest = (a, b) => a.reduce((most, value, i) => Math.max(most, Math.abs(value - b[i])), a.length === b.length ? 0 : Infinity);

// How far Gaussians are apart, as a part of kGaussianLimit. q and -q are the same rotation.
function gaussiansApart(a, b) {
  if (a.length !== b.length) return Infinity;
  let most = 0;
  for (let at = 0; at < a.length; at += 14) {
    const sign = [3, 4, 5, 6].reduce((sum, k) => sum + a[at + k] * b[at + k], 0) < 0 ? -1 : 1;
    for (let k = 0; k < 14; ++k) {
      const turns = k >= 3 && k < 7, metres = k < 10 && !turns;
      most = Math.max(most, (Math.abs(a[at + k] - (turns ? sign : 1) * b[at + k]) / kGaussianLimit) * (metres ? 10 : 1));
    }
  }
  return most;
}

// IoU of the pixels that differ from the background with those whose centre lies in a projected triangle.
function coverage({ width, height, pixels, projection: p, vertices, corners }) {
  const points = [];
  for (let v = 0; v < vertices.length; v += 3) {
    const [x, y, z] = [0, 4, 8].map((r) => p[r] * vertices[v] + p[r + 1] * vertices[v + 1] + p[r + 2] * vertices[v + 2] + p[r + 3]);
    points.push([x / z, y / z]);
  }
  const inside = new Uint8Array(width * height);
  for (let f = 0; f < corners.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => points[corners[f + k]]);
    const side = ([ax, ay], [bx, by], x, y) => (bx - ax) * (y - ay) - (by - ay) * (x - ax);
    for (let y = Math.floor(Math.min(a[1], b[1], c[1])); y < Math.max(a[1], b[1], c[1]); ++y)
      for (let x = Math.floor(Math.min(a[0], b[0], c[0])); x < Math.max(a[0], b[0], c[0]); ++x) {
        const signs = [side(a, b, x + 0.5, y + 0.5), side(b, c, x + 0.5, y + 0.5), side(c, a, x + 0.5, y + 0.5)].map(Math.sign);
        if (x >= 0 && y >= 0 && x < width && y < height && Math.abs(signs[0] + signs[1] + signs[2]) >= 2) inside[y * width + x] = 1;
      }
  }
  let both = 0, either = 0;
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) {
      const at = 4 * ((height - 1 - y) * width + x), drawn = [0, 1, 2].some((k) => Math.abs(pixels[at + k] - pixels[k]) > 2);
      both += drawn && inside[y * width + x];
      either += drawn || inside[y * width + x];
    }
  return both / either;
}

const browser = await launch(...kWebGl);
const files = await serve(readFileSync(join(folder, 'index.html')), (path) => join(folder, path));
let code = 0;
try {
  const here = await openPage(browser, `http://127.0.0.1:${files.address().port}/`, kViewport);
  const stages = await here.page.evaluate(() => window.doppel.source.about.stages.map(({ name }) => name));
  const there = url ? await openPage(browser, url, kViewport) : null;
  for (const stage of stages) {
    const found = await shown(here.page, stage, 2), iou = coverage(found);
    // Gaussians reach beyond the mesh, and those of an untrained network are small.
    assert.ok(iou > (found.gaussians ? 0.7 : 0.98), `${stage}: the picture covers the mesh with an IoU of ${iou}`);
    if (!there) continue;
    const expected = await shown(there.page, stage, 2), off = farthest(found.vertices, expected.vertices);
    assert.ok(off < 1e-5, `${stage}: vertices differ by ${off} m`);
    const texels = found.texels ? farthest(found.texels, expected.texels) : 0;
    assert.ok(texels <= 1, `${stage}: texels differ by ${texels} of 255`);
    const apart = found.gaussians ? gaussiansApart(found.gaussians, expected.gaussians) : 0;
    assert.ok(apart <= 1, `${stage}: Gaussians differ by ${apart} times what is allowed`);
    const other = found.pixels.filter((value, i) => Math.abs(value - expected.pixels[i]) > 3).length / found.pixels.length;
    assert.ok(other < 1e-3, `${stage}: ${other} of the picture's bytes differ`);
    console.log(`${stage}: vertices ${off.toExponential(1)} m, texels ${texels} of 255, Gaussians ${apart.toFixed(3)} of what is ` +
      `allowed, IoU with the mesh ${iou.toFixed(4)}`);
  }
  if (stages.includes('gaussians')) for (const { page } of there ? [here, there] : [here]) await checkGaussians(page);
  if (there) {
    await checkLive(there.page, url);
    await there.page.close();
  }
  await here.page.locator('#beside').check();
  await checkPlaying(here.page);
  await here.page.locator('#beside').uncheck();
  await here.page.locator('#stages button').first().click();
  await here.page.evaluate(() => document.getElementById('handles').click());
  await checkSlider(here.page);
  await checkReach(here.page);
  await checkPhone(here.page);
  assert.deepEqual([...here.complaints, ...(there?.complaints ?? [])], []);
  assert.deepEqual([...here.outside, ...(there?.outside ?? [])], []);
} catch (error) {
  console.error(error.message);
  code = 1;
}
await browser.close();
files.close();
process.exit(code);
