// Checks the page of `doppel view` in a browser.
//   node check_view.mjs [--picture FILE.png] DOPPEL TARGET [OPTION ...]
// The double plays, follows a slider, and its hand follows the mouse to 1 cm; the page fits a phone; the console stays
// silent; no request leaves the loopback interface; a wrong token gets 403. Exit code 1: one of these fails.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { request } from 'node:http';
import { launch } from './browser.mjs';

const given = process.argv.slice(2);
const picture = given[0] === '--picture' ? given.splice(0, 2)[1] : '';
const [program, ...target] = given;

// The address that the program prints.
function started(child) {
  return new Promise((done, failed) => {
    let text = '';
    child.stdout.on('data', (bytes) => { text += bytes; if (text.includes('\n')) done(JSON.parse(text).url); });
    child.on('exit', (code) => failed(new Error(`doppel view ended with ${code}`)));
  });
}

function status(url, { headers = {}, body = null, path = null } = {}) {
  const { hostname, port, pathname, search } = new URL(url);
  return new Promise((done) => {
    const sent = request({ hostname, port, path: path ?? pathname + search, headers, method: body ? 'POST' : 'GET' },
      (response) => { response.resume(); done(response.statusCode); });
    sent.on('error', () => done(0));
    sent.end(body);
  });
}

async function checkAccess(url) {
  const plain = url.replace(/\?.*/, ''), token = url.replace(/.*\?/, '');
  assert.equal(await status(url), 200);
  assert.equal(await status(plain), 403);
  assert.equal(await status(`${plain}?token=wrong`), 403);
  assert.equal(await status(`${plain}assets/page.js`), 403);
  assert.equal(await status(url, { headers: { Host: 'example.com' } }), 403);
  assert.equal(await status(url, { path: `/../../etc/passwd?${token}` }), 404);
  assert.equal(await status(url, { path: `/assets/..%2f..%2fetc%2fpasswd?${token}` }), 404);
  assert.equal(await status(url, { path: `/api/frame?i=-1&stage=skinning&${token}` }), 400);
  assert.equal(await status(url, { path: `/api/frame?i=0&stage=nothing&${token}` }), 400);
  assert.equal(await status(url, { path: `/api/pose?stage=skinning&${token}`, body: Buffer.alloc(7) }), 400);
  const huge = await status(url, { path: `/api/pose?stage=skinning&${token}`, body: Buffer.alloc(1 << 22) });
  assert.ok(huge === 413 || huge === 0, `a huge request got ${huge}`);
}

const drawn = (page, count) => page.waitForFunction((n) => window.doppel?.state.drawn >= n, count);
const vertices = (page) => page.evaluate(() => Array.from(window.doppel.state.geometry.vertices));
const change = (a, b) => Math.max(...a.map((value, i) => Math.abs(value - b[i])));

async function checkPlaying(page) {
  await drawn(page, 1);
  const first = await vertices(page);
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.doppel.state.frame > 3);
  await page.keyboard.press('Space');
  const last = await page.evaluate(() => window.doppel.state.frame);
  assert.ok(change(first, await vertices(page)) > 1e-3, 'playing moves nothing');
  await page.keyboard.press('ArrowLeft');
  await page.waitForFunction((frame) => window.doppel.state.frame === frame - 1, last);
}

async function checkSlider(page) {
  const before = await vertices(page), count = await page.evaluate(() => window.doppel.state.drawn);
  const slider = page.locator('#dofs input').last();
  await slider.evaluate((input) => {
    input.value = (Number(input.min) + Number(input.max)) / 2 + 0.4 * (Number(input.max) - Number(input.min));
    input.dispatchEvent(new Event('input'));
  });
  await drawn(page, count + 1);
  assert.ok(change(before, await vertices(page)) > 1e-3, 'the slider moves nothing');
}

// Drags the outermost joint of an arm by 40 pixels.
async function checkReach(page) {
  await page.locator('#rest').click();
  await page.waitForTimeout(300);
  const start = await page.evaluate(() => {
    const { picture, source } = window.doppel, { joints } = source.about;
    let hand = joints.findLastIndex((joint) => /(left|l_?|\.l).*(hand|wrist)|(hand|wrist).*(left|_l|\.l)/i.test(joint.name));
    if (hand < 0) hand = joints.reduce((best, _, j) => (picture.jointAt(j).x > picture.jointAt(best).x ? j : best), 0);
    const p = picture.jointAt(hand).project(picture.camera), box = picture.renderer.domElement.getBoundingClientRect();
    return { name: joints[hand].name, x: box.left + ((p.x + 1) / 2) * box.width, y: box.top + ((1 - p.y) / 2) * box.height };
  });
  await page.mouse.move(start.x, start.y);
  await page.mouse.down();
  for (let step = 1; step <= 8; ++step) {
    await page.mouse.move(start.x - 3 * step, start.y - 5 * step);
    await page.waitForTimeout(60);
  }
  await page.mouse.up();
  await page.waitForTimeout(400);
  const distance = await page.evaluate(() => window.doppel.state.reached?.distance);
  assert.ok(distance < 0.01, `${start.name} stays ${distance} m from the mouse`);
  console.log(`${start.name} reaches the mouse to ${(1000 * distance).toFixed(2)} mm`);
}

const child = spawn(program, ['view', ...target, '--port', '0', '--no-open', '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
const browser = await launch('--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader');
let code = 0;
try {
  const url = await started(child), complaints = [], outside = [];
  await checkAccess(url);
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: 'dark' });
  page.on('console', (message) => { if (message.type() === 'error') complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (sent) => { if (!/^(http:\/\/127\.0\.0\.1[:/]|data:|blob:)/.test(sent.url())) outside.push(sent.url()); });
  await page.goto(url);
  await checkPlaying(page);
  await checkSlider(page);
  await checkReach(page);
  if (picture) await page.screenshot({ path: picture });
  await page.setViewportSize({ width: 390, height: 780 });
  await page.waitForTimeout(200);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= 390), 'the page is wider than a phone');
  assert.deepEqual(complaints, []);
  assert.deepEqual(outside, []);
} catch (error) {
  console.error(error.message);
  code = 1;
}
await browser.close();
child.removeAllListeners('exit');
child.kill('SIGINT');
const ended = await new Promise((done) => { child.on('exit', done); setTimeout(() => done('no end'), 5000); });
if (ended !== 0) { console.error(`after Ctrl-C doppel view ended with ${ended}`); code = 1; }
process.exit(code);
