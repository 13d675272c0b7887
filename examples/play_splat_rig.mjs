// What a player of `doppel animate --format splat-rig` computes for a frame: centres and covariances of the Gaussians.
// No packages. In an engine, the loop over Gaussians belongs into a shader.
//   node play_splat_rig.mjs splats_rig.glb [SECONDS [GAUSSIAN]]    prints the rate, and a Gaussian at this time
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const kTypes = { 5121: Uint8Array, 5123: Uint16Array, 5126: Float32Array };
const kWidths = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };
const kExtension = 'KHR_gaussian_splatting';

/** The arrays of a file. @param bytes ArrayBuffer of a .glb */
export function readRig(bytes) {
  const length = new DataView(bytes).getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, length)));
  const rows = (index) => {
    const accessor = json.accessors[index], view = json.bufferViews[accessor.bufferView];
    const first = 28 + length + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    const Type = kTypes[accessor.componentType], count = accessor.count * kWidths[accessor.type];
    return new Type(bytes.slice(first, first + count * Type.BYTES_PER_ELEMENT));
  };
  const { attributes } = json.meshes[0].primitives[0], skin = json.skins[0], animation = json.animations[0];
  const parents = new Int32Array(json.nodes.length).fill(-1);
  json.nodes.forEach((node, i) => (node.children ?? []).forEach((child) => (parents[child] = i)));
  return {
    nodes: json.nodes, parents, bones: skin.joints, inverse: rows(skin.inverseBindMatrices),
    channels: animation.channels.map(({ sampler, target }) => ({
      ...target, times: rows(animation.samplers[sampler].input), values: rows(animation.samplers[sampler].output) })),
    centres: rows(attributes.POSITION), joints: rows(attributes.JOINTS_0), weights: rows(attributes.WEIGHTS_0),
    rotations: rows(attributes[`${kExtension}:ROTATION`]), scales: rows(attributes[`${kExtension}:SCALE`]),
  };
}

/** The 3x3 matrix of a quaternion x y z w, rows first. */
const turn = ([x, y, z, w]) => [
  1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
  2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
  2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];

/** A channel between its keys: linear, and spherical for quaternions. */
function sampled({ path, times, values }, seconds) {
  const width = path === 'rotation' ? 4 : 3;
  let after = times.findIndex((time) => time >= seconds);
  if (after < 0) after = times.length - 1;
  const before = Math.max(0, after - 1), span = times[after] - times[before];
  const share = span > 0 ? (seconds - times[before]) / span : 0;
  const row = (key) => values.subarray(key * width, (key + 1) * width), a = row(before), b = row(after);
  let from = 1 - share, to = share;
  if (path === 'rotation') {
    const cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    const angle = Math.acos(Math.min(1, Math.abs(cosine)));
    if (angle > 1e-4) [from, to] = [Math.sin(from * angle) / Math.sin(angle), Math.sin(to * angle) / Math.sin(angle)];
    if (cosine < 0) to = -to;
  }
  return Array.from(a, (value, i) => from * value + to * b[i]);
}

/** G B^-1 of each joint, 3x4, rows first. */
function jointMatrices(rig, seconds) {
  const local = rig.nodes.map(({ rotation = [0, 0, 0, 1], translation = [0, 0, 0] }) => ({ rotation, translation }));
  for (const channel of rig.channels) local[channel.node][channel.path] = sampled(channel, seconds);
  const world = [];
  const times = (a, b) => Array.from({ length: 12 }, (_, i) => {
    const r = i - (i % 4), c = i % 4;
    return a[r] * b[c] + a[r + 1] * b[4 + c] + a[r + 2] * b[8 + c] + (c === 3 ? a[r + 3] : 0);
  });
  const at = (node) => (world[node] ??= (() => {
    const r = turn(local[node].rotation), t = local[node].translation;
    const own = [r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2]];
    return rig.parents[node] < 0 ? own : times(at(rig.parents[node]), own);
  })());
  return rig.bones.map((node, j) => {
    const m = rig.inverse.subarray(16 * j, 16 * j + 16);  // columns first
    return times(at(node), [m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]]);
  });
}

/** Gaussians at a time: centres [3P] and covariances [6P] (xx xy xz yy yz zz), metres. */
export function pose(rig, seconds, out) {
  const matrices = jointMatrices(rig, seconds), M = new Float64Array(12), A = new Float64Array(9);
  for (let i = 0; i < rig.centres.length / 3; ++i) {
    M.fill(0);
    for (let k = 4 * i; k < 4 * i + 4; ++k) {
      const weight = rig.weights[k], matrix = matrices[rig.joints[k]];
      if (weight > 0) for (let e = 0; e < 12; ++e) M[e] += weight * matrix[e];
    }
    const R = turn(rig.rotations.subarray(4 * i, 4 * i + 4)), x = rig.centres.subarray(3 * i, 3 * i + 3);
    for (let r = 0; r < 3; ++r) {
      out.centres[3 * i + r] = M[4 * r] * x[0] + M[4 * r + 1] * x[1] + M[4 * r + 2] * x[2] + M[4 * r + 3];
      for (let c = 0; c < 3; ++c)  // A = M3 R diag(s), and the covariance is A A^T
        A[3 * r + c] = rig.scales[3 * i + c] * (M[4 * r] * R[c] + M[4 * r + 1] * R[3 + c] + M[4 * r + 2] * R[6 + c]);
    }
    for (let r = 0, e = 6 * i; r < 3; ++r)
      for (let c = r; c < 3; ++c, ++e)
        out.covariances[e] = A[3 * r] * A[3 * c] + A[3 * r + 1] * A[3 * c + 1] + A[3 * r + 2] * A[3 * c + 2];
  }
  return out;
}

if (process.argv[1] && import.meta.url === pathToFileURL(process.argv[1]).href) {
  const rig = readRig(new Uint8Array(readFileSync(process.argv[2])).buffer), count = rig.centres.length / 3;
  const out = { centres: new Float32Array(3 * count), covariances: new Float32Array(6 * count) };
  const start = performance.now(), frames = 20;
  for (let i = 0; i < frames; ++i) pose(rig, i / 25, out);
  const rate = (1000 * frames) / (performance.now() - start);
  const seconds = Number(process.argv[3] ?? 0), i = Number(process.argv[4] ?? 0);
  pose(rig, seconds, out);
  console.log(JSON.stringify({ gaussians: count, frames_per_second: Math.round(rate),
    centre: Array.from(out.centres.subarray(3 * i, 3 * i + 3)),
    covariance: Array.from(out.covariances.subarray(6 * i, 6 * i + 6)) }));
}
