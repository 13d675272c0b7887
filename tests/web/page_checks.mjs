// What the viewer's page must do, from a server and from a folder alike.
import assert from 'node:assert/strict';

export const kWebGl = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

// A page with all that its console complains about and all requests that leave the loopback interface.
export async function openPage(browser, url, viewport = { width: 1280, height: 800 }) {
  const page = await (await browser.newContext({ viewport, colorScheme: 'dark' })).newPage();
  const complaints = [], outside = [];
  page.on('console', (message) => { if (message.type() === 'error') complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (sent) => { if (!/^(http:\/\/127\.0\.0\.1[:/]|data:|blob:)/.test(sent.url())) outside.push(sent.url()); });
  page.setDefaultTimeout(180000);  // networks in WebAssembly beside other tests: minutes, but not for ever
  await page.goto(url);
  await drawn(page, 1);
  await idle(page);
  return { page, complaints, outside };
}

const idle = (page) => page.waitForFunction(() => window.doppel?.idle());
const drawn = (page, count) => page.waitForFunction((n) => window.doppel?.state.drawn >= n, count);
const vertices = (page) => page.evaluate(() => Array.from(window.doppel.state.geometry.vertices));
const change = (a, b) => Math.max(...a.map((value, i) => Math.abs(value - b[i])));

export async function checkPlaying(page) {
  await idle(page);
  const first = await vertices(page);
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.doppel.state.frame > 3);
  await page.keyboard.press('Space');
  await idle(page);
  const last = await page.evaluate(() => window.doppel.state.frame);
  assert.ok(change(first, await vertices(page)) > 1e-3, 'playing moves nothing');
  await page.keyboard.press('ArrowLeft');
  await page.waitForFunction((frame) => window.doppel.state.frame === frame - 1, last);
}

export async function checkSlider(page) {
  await idle(page);
  const before = await vertices(page);
  const slider = page.locator('#dofs input').last();
  await slider.evaluate((input) => {
    input.value = (Number(input.min) + Number(input.max)) / 2 + 0.4 * (Number(input.max) - Number(input.min));
    input.dispatchEvent(new Event('input'));
  });
  await idle(page);
  assert.ok(change(before, await vertices(page)) > 1e-3, 'the slider moves nothing');
}

// Drags a hand, else the joint that most DoFs move, by 40 pixels.
export async function checkReach(page) {
  await page.locator('#rest').click();
  await idle(page);
  const start = await page.evaluate(() => {
    const { picture, source } = window.doppel, { joints } = source.about;
    let hand = joints.findLastIndex((joint) => /(left|l_?|\.l).*(hand|wrist)|(hand|wrist).*(left|_l|\.l)/i.test(joint.name));
    if (hand < 0) hand = joints.reduce((best, joint, j) => (joint.moved_by.length > joints[best].moved_by.length ? j : best), 0);
    const box = picture.renderer.domElement.getBoundingClientRect();
    const pixel = (j) => {
      const p = picture.jointAt(j).project(picture.camera);
      return { x: box.left + ((p.x + 1) / 2) * box.width, y: box.top + ((1 - p.y) / 2) * box.height };
    };
    const from = pixel(hand), root = pixel(0), angle = Math.atan2(root.y - from.y, root.x - from.x) + Math.PI / 4;
    return { name: joints[hand].name, ...from, dx: 40 * Math.cos(angle), dy: 40 * Math.sin(angle) };
  });
  await page.mouse.move(start.x, start.y);
  await page.mouse.down();
  for (let step = 1; step <= 8; ++step) {
    await page.mouse.move(start.x + (start.dx * step) / 8, start.y + (start.dy * step) / 8);
    await page.waitForTimeout(60);
  }
  await page.mouse.up();
  await idle(page);
  const { distance, outside } = await page.evaluate(() => {
    const { state, source } = window.doppel;
    const outside = source.about.dofs.filter(({ limits }, d) => limits &&
      (state.edited[d] < limits[0] - 1e-5 || state.edited[d] > limits[1] + 1e-5));
    return { distance: state.reached?.distance, outside: outside.map(({ name }) => name) };
  });
  assert.ok(distance < 0.01, `${start.name} stays ${distance} m from the mouse`);
  assert.deepEqual(outside, [], 'DoFs beyond their limits');
  console.log(`${start.name} reaches the mouse to ${(1000 * distance).toFixed(2)} mm`);
}

// The Gaussians are those for the camera of the page, also after it was turned, and half opaque they give the mean of the
// picture with them and the picture without.
export async function checkGaussians(page) {
  await page.getByRole('radio', { name: 'gaussians' }).click();
  await idle(page);
  const box = await page.locator('#stage canvas').boundingBox(), before = await page.evaluate(() => window.doppel.state.drawn);
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + 80, box.y + 40, { steps: 4 });
  await page.mouse.up();
  await drawn(page, before + 1);
  await idle(page);
  const { apart, off, change: seen } = await page.evaluate(async () => {
    const { state, source, picture } = window.doppel, slider = document.getElementById('opacity');
    const now = await source.frame(state.frame, state.stage, picture.projection());
    const far = (a, b) => a.reduce((most, value, i) => Math.max(most, Math.abs(value - b[i])), 0);
    const image = (opacity) => {
      slider.value = opacity;
      slider.dispatchEvent(new Event('input'));
      picture.renderer.render(picture.scene, picture.camera);
      const gl = picture.renderer.getContext(), pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
      gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      return pixels;
    };
    const [none, half, whole] = [0, 0.5, 1].map(image);
    const mean = Array.from(none, (value, i) => (value + whole[i]) / 2);
    return { apart: far(now.gaussians, state.geometry.gaussians), change: far(none, whole), off: far(half, mean) };
  });
  assert.ok(apart < 1e-6, 'the Gaussians are not those for this camera');
  assert.ok(seen > 20 && off <= 2, `half opaque Gaussians are ${off} of 255 from half a picture, and ${seen} is seen of them`);
}

// Opens an image from the disk as the texture.
export async function checkTexture(page) {
  const red = await page.evaluate(async () => {
    const canvas = new OffscreenCanvas(4, 4), context = canvas.getContext('2d');
    context.fillStyle = '#ff0000';
    context.fillRect(0, 0, 4, 4);
    return Array.from(new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer()));
  });
  await page.locator('#open').setInputFiles({ name: 'red.png', mimeType: 'image/png', buffer: Buffer.from(red) });
  await page.waitForFunction(() => window.doppel.picture.image?.image.width === 4);
}

// Opens a motion file with `frames` frames.
export async function checkMotion(page, file, frames) {
  await page.locator('#open').setInputFiles(file);
  await page.waitForFunction((n) => window.doppel.source.about.frames === n, frames);
  await idle(page);
}

// Where the page shows the cameras of a capture: looks through each, and the picture of the frame stands behind the double
// as the camera filmed it. The page projects the joints as the camera does.
export async function checkCameras(page) {
  await page.locator('#follow').click({ timeout: 500 }).catch(() => {});  // from a pose by hand
  const { cameras } = await page.evaluate(() => window.doppel.source.cameras);
  for (let index = 0; index < cameras.length; ++index) {
    await page.locator('#camera').selectOption(String(index));
    await idle(page);
    const off = await page.evaluate((i) => {
      const { picture, source, state } = window.doppel, { K, R, t, width, height } = source.cameras.cameras[i];
      const corner = picture.cameras.sheet.geometry.getAttribute('position'), place = picture.anchor().clone(), at = place.clone();
      picture.camera.updateMatrixWorld();
      const onPage = (point) => point.project(picture.camera).toArray();
      const [left, bottom] = onPage(at.fromBufferAttribute(corner, 3)), [right, top] = onPage(at.fromBufferAttribute(corner, 1));
      const seen = R.map((row, r) => row[0] * place.x + row[1] * place.y + row[2] * place.z + t[r]);
      const pixel = [0, 1].map((r) => (K[r][0] * seen[0] + K[r][1] * seen[1] + K[r][2] * seen[2]) / seen[2]);
      const [x, y] = onPage(place.clone());
      const shown = [((x - left) / (right - left)) * width, ((top - y) / (top - bottom)) * height];
      return picture.cameras.sheet.visible && state.drawn ? Math.hypot(shown[0] - pixel[0], shown[1] - pixel[1]) : NaN;
    }, index);
    assert.ok(off < 0.5, `${cameras[index].name}: the joint is ${off} pixels from its place in the picture`);
  }
  await page.locator('#mask').check();
  await page.keyboard.press('ArrowRight');
  await idle(page);
  console.log(`${cameras.length} cameras of the capture hold their pictures behind the double`);
}

// A capture without a character: the person's points play, and nothing asks for a double.
export async function checkSequence(page) {
  for (const id of ['stages', 'texture', 'beside', 'open', 'opacity', 'rest', 'find', 'dofs', 'mirror'])
    assert.ok(!(await page.locator(`#${id}`).isVisible()), `#${id} is shown without a double`);
  const points = () => page.evaluate(() => window.doppel.picture.figure.found.flatMap((place) => place.toArray()));
  await idle(page);
  const first = await points();
  assert.ok(first.length > 3 * 10, `${first.length / 3} points are shown`);
  await page.keyboard.press('r');  // no double takes the rest pose
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.doppel.state.frame > 2);
  await page.keyboard.press('Space');
  await idle(page);
  const last = await points();
  assert.ok(Math.abs(first[1] - last[1]) + Math.abs(first[0] - last[0]) > 1e-4, 'playing moves no point');
  await page.locator('#scrub').evaluate((input) => { input.value = 1; input.dispatchEvent(new Event('input')); });
  await idle(page);
  assert.equal(await page.evaluate(() => window.doppel.state.frame), 1);
  console.log(`${await page.locator('#facts').textContent()}: the points play`);
}

// Sends poses as a tracker does; the double follows each, and the page says that it is live. @param url of the page
export async function checkLive(page, url) {
  await idle(page);
  const { rest, window } = await page.evaluate(() => {
    const { about } = window.doppel.source;
    return { rest: about.rest, window: 1 + Math.max(...about.stages.map(({ past_frames }) => past_frames)) };
  });
  const send = (values) => fetch(url.replace('/?', '/api/live?tracked=1&'), { method: 'POST', body: Float32Array.from(values) });
  // A page that is slow for two seconds takes a pose for an old one, so it is sent again.
  const shown = (pose) => page.waitForFunction((last) => window.doppel.state.live?.dofs.at(-1) === last,
    Math.fround(pose.at(-1)), { timeout: 2000 }).then(() => true, () => false);
  let pose = rest;
  for (let k = 1; k <= 20; ++k) {
    pose = [...rest.slice(0, -1), rest.at(-1) + 0.02 * k];
    do assert.equal((await send(pose)).status, 200); while (!(await shown(pose)));
  }
  for (let row = 0; row < window; ++row)  // a window of equal poses
    do await send(pose); while (!(await shown(pose)));
  await page.waitForTimeout(200);
  const { off, moved } = await page.evaluate(async () => {
    const { state, source, picture } = window.doppel, far = (a, b) => a.reduce((most, v, i) => Math.max(most, Math.abs(v - b[i])), 0);
    const all = ({ vertices, gaussians }) => [...vertices, ...(gaussians ?? [])], shown = all(state.geometry);
    const at = async (dofs) => all(await source.pose(dofs, state.stage, picture.projection()));
    return { off: far(shown, await at(state.edited)), moved: far(shown, await at(Float32Array.from(source.about.rest))) };
  });
  assert.ok(off < 1e-6, `the live double is ${off} m from its pose`);
  assert.ok(moved > 1e-3, 'the live poses move nothing');
  do await send(pose); while (!(await shown(pose)));
  const text = await page.locator('#rate').textContent();
  assert.match(text, /^live, [0-9.]+ poses a second$/);
  await page.waitForFunction(() => window.doppel.state.live === null);
  assert.equal((await send([0])).status, 400);
  console.log(`the double follows live poses; the page says: ${text}`);
}

// The curves of a run's training.
export async function checkTraining(page) {
  await page.waitForFunction(() => document.querySelectorAll('#progress polyline').length > 0);
}

export async function leaveCameras(page) {
  await page.locator('#mask').uncheck();
  await page.locator('#camera').selectOption('-1');
  await idle(page);
}

export async function checkPhone(page) {
  await page.setViewportSize({ width: 390, height: 780 });
  await page.waitForTimeout(200);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= 390), 'the page is wider than a phone');
}
