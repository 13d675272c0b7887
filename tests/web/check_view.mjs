// Checks the page of `doppel view` in a browser.
//   node check_view.mjs [--sequence FILE.png] [--picture FILE.png] [--cameras FILE.png] [--other MOTION FRAMES] DOPPEL TARGET [OPTION ...]
// --sequence: the target is a capture without a character, with masks and keypoints; a screenshot. No other option.
// --cameras: the target is a capture with pictures, which must stand where its cameras saw them; a screenshot.
// --other: a motion file of this many frames, which the page opens.
// The double plays, follows a slider and live poses, and its hand follows the mouse to 1 cm; the page fits a phone; the
// console stays silent; no request leaves the loopback interface; a wrong token gets 403; a page of another port gets
// nothing. Exit code 1: one of these fails.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createServer, request } from 'node:http';
import { launch } from './browser.mjs';
import {
  checkCameras, checkLive, checkMotion, checkPhone, checkPlaying, checkReach, checkSequence, checkSlider, checkTexture, checkTraining, kWebGl, leaveCameras, openPage,
} from './page_checks.mjs';

const given = process.argv.slice(2);
const sequence = given[0] === '--sequence' ? given.splice(0, 2)[1] : '';
const picture = given[0] === '--picture' ? given.splice(0, 2)[1] : '';
const cameras = given[0] === '--cameras' ? given.splice(0, 2)[1] : '';
const other = given[0] === '--other' ? given.splice(0, 3).slice(1) : null;
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
  assert.equal(await status(`${plain}api/live?tracked=1`, { body: Buffer.alloc(8) }), 403);
  assert.equal(await status(url, { headers: { Host: 'example.com' } }), 403);
  assert.equal(await status(url, { path: `/../../etc/passwd?${token}` }), 404);
  assert.equal(await status(url, { path: `/assets/..%2f..%2fetc%2fpasswd?${token}` }), 404);
  assert.equal(await status(url, { path: `/api/frame?i=-1&stage=skinning&${token}` }), 400);
  assert.equal(await status(url, { path: `/api/frame?i=0&stage=nothing&${token}` }), 400);
  assert.equal(await status(url, { path: `/api/pose?stage=skinning&${token}`, body: Buffer.alloc(7) }), 400);
  const huge = await status(url, { path: `/api/pose?stage=skinning&${token}`, body: Buffer.alloc(1 << 22) });
  assert.ok(huge === 413 || huge === 0, `a huge request got ${huge}`);
}

// A page of another port, beside the open one, is sent nothing of the viewer's, learns nothing, and sends no pose.
async function checkOtherPort(page, url) {
  const heard = [], server = createServer((asked, answer) => {
    heard.push(JSON.stringify(asked.rawHeaders) + asked.url);
    answer.setHeader('Content-Type', 'text/html').end('<link rel="icon" href="data:,"><p>another page</p>');
  });
  await new Promise((done) => { server.listen(0, '127.0.0.1', done); });
  const other = await page.context().newPage(), token = new URL(url).searchParams.get('token');
  await other.goto(`http://127.0.0.1:${server.address().port}/`);
  const rest = await page.evaluate(() => window.doppel.source.about.rest ?? []);
  const answers = await other.evaluate(async ({ viewer, dofs }) => {
    const asked = async (path, options) => fetch(viewer.replace('/?', `/${path}&`), options).then(({ type, status }) => `${type} ${status}`, () => 'nothing');
    const pose = { method: 'POST', body: Float32Array.from(dofs) };
    return [
      await asked('api/live?tracked=1', { ...pose, mode: 'no-cors', credentials: 'include' }),
      await asked('api/live?tracked=1', pose),
      await asked('double/description.json?', {}),
      await asked('api/live?tracked=1', { ...pose, headers: { 'Doppel-Token': '0' } }),
    ];
  }, { viewer: url, dofs: rest });
  assert.deepEqual(answers, ['opaque 0', 'nothing', 'nothing', 'nothing']);
  assert.ok(heard.length > 0 && !heard.some((text) => text.includes(token) || /cookie/i.test(text)), `another port was sent ${heard}`);
  assert.deepEqual(await page.context().cookies(), []);
  if (rest.length) {
    const live = await fetch(url.replace('/?', '/api/live?after=0&stage=skinning&'));
    assert.equal((await live.arrayBuffer()).byteLength, 0, 'a page of another port has sent a pose');
  }
  for (const headers of [{ Origin: `http://127.0.0.1:${server.address().port}` }, { Origin: 'null' }, { 'Sec-Fetch-Site': 'same-site' }])
    assert.equal(await status(url.replace('/?', '/api/live?tracked=1&'), { headers, body: Buffer.alloc(4) }), 403);
  await other.close();
  server.close();
}

async function checkDouble(page, url) {
  await checkPlaying(page);
  await checkSlider(page);
  await checkReach(page);
  await checkLive(page, url);
  if (picture) {
    await page.evaluate(() => document.getElementById('panel').scrollTo(0, 0));
    await page.screenshot({ path: picture });
  }
  if (await page.evaluate(() => window.doppel.source.about.training)) await checkTraining(page);
  if (cameras) {
    await checkCameras(page);
    await page.screenshot({ path: cameras });
    await leaveCameras(page);
  }
  await checkTexture(page);
  if (other) {
    await checkMotion(page, other[0], Number(other[1]));
    await checkPlaying(page);
  }
}

async function checkWithoutDouble(page) {
  await checkSequence(page);
  await page.screenshot({ path: sequence });
  await checkCameras(page);
  await leaveCameras(page);
}

const child = spawn(program, ['view', ...target, '--port', '0', '--no-open', '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
const browser = await launch(...kWebGl);
let code = 0;
try {
  const url = await started(child);
  await checkAccess(url);
  const { page, complaints, outside } = await openPage(browser, url);
  await checkOtherPort(page, url);
  if (sequence) await checkWithoutDouble(page);
  else await checkDouble(page, url);
  await checkPhone(page);
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
