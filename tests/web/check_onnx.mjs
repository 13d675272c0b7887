// Checks ONNX models in ONNX Runtime against the values of the C++ library.
//   node check_onnx.mjs [--browser] FOLDER
// FOLDER holds NAME.onnx with NAME.INPUT.npy and NAME.OUTPUT.npy for each of its inputs and outputs.
// --browser: in Chromium by WebAssembly with one thread, and prints the calls a second.
// Exit code 1: an output differs by more than is allowed (below).
import { readdirSync } from 'node:fs';
import { join } from 'node:path';
import { readNpy } from './npy.mjs';

// Two libraries sum float32 products in different orders. Graphs and skinning: 1e-5; textures and Gaussians: 1e-3. The pose
// networks see images: each of some L = 20 layers of ResNet-18 sums up to K = 9 * 512 products. Independent rounding errors
// grow with the root of their number, so four standard deviations are 4 u sqrt(L K) of the largest value, with u = 2^-24.
const kTolerance = 1e-5, kTextureTolerance = 1e-3, kImageTolerance = 4 * 2 ** -24 * Math.sqrt(20 * 9 * 512);
const folder = process.argv.at(-1), in_browser = process.argv.includes('--browser');

async function inNode(path, feeds) {
  const ort = (await import('onnxruntime-node')).default;
  const session = await ort.InferenceSession.create(path, { logSeverityLevel: 3 });
  const named = {};
  for (const name of session.inputNames) named[name] = new ort.Tensor('float32', feeds(name).values, feeds(name).shape);
  const found = await session.run(named);
  return session.outputNames.map((name) => ({ name, shape: found[name].dims, values: found[name].data }));
}

const page_text = `<!doctype html><script type="module">
import * as ort from '/modules/onnxruntime-web/dist/ort.wasm.min.mjs';
ort.env.wasm.numThreads = 1;
ort.env.wasm.wasmPaths = '/modules/onnxruntime-web/dist/';
window.load = async () => {
  window.session = await ort.InferenceSession.create('/model.onnx', { logSeverityLevel: 3 });
  return { inputs: window.session.inputNames, outputs: window.session.outputNames };
};
window.run = async (feeds) => {
  const named = {};
  for (const [name, { shape, values }] of Object.entries(feeds))
    named[name] = new ort.Tensor('float32', Float32Array.from(values), shape);
  const found = await window.session.run(named), begin = performance.now();
  let calls = 0;
  for (; performance.now() - begin < 1000; ++calls) await window.session.run(named);
  const seconds = (performance.now() - begin) / 1000;
  return { rate: calls / seconds, outputs: Object.entries(found).map(([name, tensor]) =>
    ({ name, shape: tensor.dims, values: Array.from(tensor.data) })) };
};
window.ready = true;
</script>`;

async function inBrowser(path, feeds) {
  const { launch, serve, open } = await import('./browser.mjs');
  const browser = await launch(), server = await serve(page_text, (url) => (url === '/model.onnx' ? path : ''));
  const { page, complaints } = await open(browser, server);
  await page.waitForFunction(() => window.ready);
  const { inputs } = await page.evaluate(() => window.load());
  const named = {};
  for (const name of inputs) named[name] = { shape: feeds(name).shape, values: Array.from(feeds(name).values) };
  const { rate, outputs } = await page.evaluate((f) => window.run(f), named);
  console.log(`${path}: ${rate.toFixed(1)} batches of ${Object.values(named)[0].shape[0]} a second (WebAssembly, one thread)`);
  await browser.close();
  server.close();
  if (complaints.length) throw new Error(complaints.join('\n'));
  return outputs;
}

// Rows [14] of Gaussians as they are compared: q and -q are the same rotation, so every quaternion is multiplied by its
// largest number; and metres by 10, so that the limit allows 0.1 mm.
function comparable(values) {
  const rows = Float32Array.from(values);
  for (let row = 0; row < rows.length; row += 14) {
    const q = rows.subarray(row + 3, row + 7), largest = q.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
    q.forEach((value, k) => { q[k] = value * largest; });
    for (const k of [0, 1, 2, 7, 8, 9]) rows[row + k] *= 10;
  }
  return rows;
}

let good = true;
for (const file of readdirSync(folder).filter((name) => name.endsWith('.onnx'))) {
  const path = join(folder, file), values = (name) => readNpy(path.replace(/onnx$/, `${name}.npy`));
  for (const { name, shape, values: output } of await (in_browser ? inBrowser : inNode)(path, values)) {
    const wanted = values(name), compared = name === 'gaussians' ? comparable : (numbers) => numbers;
    const found = compared(output), expected = { shape: wanted.shape, values: compared(wanted.values) };
    let worst = expected.shape.join() === shape.join() ? 0 : Infinity;
    for (let i = 0; i < found.length; ++i) {
      const off = Math.abs(found[i] - expected.values[i]);
      if (!(off <= worst)) worst = off;  // NaN is kept
    }
    const largest = expected.values.reduce((most, value) => Math.max(most, Math.abs(value)), 1);
    const limit = file === 'pose.onnx' ? kImageTolerance * largest : name === 'texture' || name === 'gaussians' ? kTextureTolerance : kTolerance;
    console.log(`${file}: ${name} [${shape}] differs by ${worst.toExponential(2)}, ${limit.toExponential(2)} is allowed`);
    good = good && worst <= limit;
  }
}
process.exit(good ? 0 : 1);
