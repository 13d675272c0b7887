// The double's networks in this page, by ONNX Runtime (WebAssembly, one thread).
export async function folderNetworks(about, dofsOf) {
  const here = new URL('.', document.baseURI).href;
  const ort = await import(/* @vite-ignore */ `${here}runtime/ort.wasm.min.mjs`);
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmPaths = `${here}runtime/`;
  const opened = new Map();
  const network = (name) => {
    if (!opened.has(name)) opened.set(name, ort.InferenceSession.create(`${here}double/${name}.onnx`));
    return opened.get(name);
  };
  const tensor = (values, shape) => new ort.Tensor('float32', Float32Array.from(values), shape);

  async function joints(poses) {
    const session = await network('joints');
    return (await session.run({ dofs: tensor(poses, [poses.length / about.dofs.length, about.dofs.length]) })).joints.data;
  }

  // Poses of a window, oldest first.
  async function geometry(rows, stage, projection) {
    const window = tensor(rows.flatMap((row) => Array.from(row)), [1, rows.length, about.dofs.length]);
    const { vertices } = await (await network(stage.geometry)).run({ window });
    let look = {};
    if (stage.geometry !== stage.name)
      look = await (await network(stage.name)).run({ window, projection: tensor(projection, [1, 3, 4]), vertices });
    return { vertices: vertices.data, joints: await joints(rows.at(-1)), texels: look.texture ? bytesOf(look.texture.data) : null,
      gaussians: look.gaussians?.data ?? null };
  }

  return {
    joints,
    frame: (i, stage, projection) => {
      const rows = [], first = about.cuts.findLast((cut) => cut <= i) ?? 0;  // no window reaches before a cut
      for (let back = stage.past_frames; back >= 0; --back) rows.push(dofsOf(Math.max(first, i - back)));
      return geometry(rows, stage, projection);
    },
    pose: (dofs, stage, projection) => geometry(Array(stage.past_frames + 1).fill(dofs), stage, projection),
  };
}

// RGB 0..1 -> RGBA bytes
function bytesOf(colours) {
  const texels = new Uint8Array((4 * colours.length) / 3).fill(255);
  for (let t = 0, c = 0; c < colours.length; t += 4)
    for (let k = 0; k < 3; ++k) texels[t + k] = Math.round(255 * Math.min(1, Math.max(0, colours[c++])));
  return texels;
}
