// The double: sizes, mesh, motion, and the geometry of poses. `doppel view` computes it, or, in an exported folder, the
// page itself by ONNX Runtime.
import { folderNetworks } from './networks.js';

// The token of the page's own address; none in an exported folder. Requests of this page have it in a header. No cookie
// has it, because a browser sends cookies to the servers of other ports too.
const token = new URLSearchParams(location.search).get('token');

// The address of an image, which the browser loads without a header.
const imageAddress = (path, query = {}) => (token ? `${path}?${new URLSearchParams({ ...query, token })}` : path);

async function fetched(path, body) {
  const headers = token ? { 'Doppel-Token': token } : {};
  const response = await fetch(path, body ? { method: 'POST', headers, body } : { headers });
  if (!response.ok) throw new Error(`${path}: ${await response.text()}`);
  return response;
}
const bytesOf = async (path, body) => (await fetched(path, body)).arrayBuffer();

// Geometry: { vertices [3N], joints [3J], texels: RGBA bytes [4TT] or null, gaussians: rows [14P] or null }
function serverNetworks(about) {
  const address = (path, stage, projection, query = {}) => `${path}?${new URLSearchParams(
    { ...query, stage: stage.name, ...(projection ? { projection } : {}) })}`;
  const split = (bytes, { texture_size: size, gaussians: count }) => {
    const joints = 12 * about.vertices, look = joints + 12 * about.joints.length;
    return {
      vertices: new Float32Array(bytes, 0, 3 * about.vertices), joints: new Float32Array(bytes, joints, 3 * about.joints.length),
      texels: size ? new Uint8Array(bytes, look, 4 * size * size) : null,
      gaussians: count ? new Float32Array(bytes, look, 14 * count) : null,
    };
  };
  return {
    frame: async (i, stage, projection) => split(await bytesOf(address('api/frame', stage, projection, { i, motion: about.motion })), stage),
    pose: async (dofs, stage, projection) => split(await bytesOf(address('api/pose', stage, projection), dofs), stage),
    // Waits for a pose that is tracked now and comes after pose number `after`; null: there was none
    live: async (after, stage, projection) => {
      const bytes = await bytesOf(address('api/live', stage, projection, { after }));
      if (!bytes.byteLength) return null;
      const [number, tracked] = new Uint32Array(bytes, 0, 2), end = 8 + 4 * about.dofs.length;
      return { number, tracked: tracked === 1, dofs: new Float32Array(bytes.slice(8, end)), geometry: split(bytes.slice(end), stage) };
    },
    joints: async (poses) => new Float32Array(await bytesOf('api/joints', poses)),
  };
}

export async function open() {
  const about = await (await fetched('double/description.json')).json();
  const bytes = await bytesOf('double/mesh.bin');
  const [corners, split] = new Uint32Array(bytes, 0, 2);
  const mesh = {
    corners: new Uint32Array(bytes, 8, corners),
    source: new Uint32Array(bytes, 8 + 4 * corners, split),
    uvs: new Float32Array(bytes, 8 + 4 * (corners + split), 2 * split),
  };
  const in_folder = document.body.dataset.source === 'folder';
  const motionRows = async (number) => new Float32Array(await bytesOf(in_folder ? 'double/motion.bin' : `double/motion.bin?motion=${number}`));
  let motion = await motionRows(about.motion);
  const dofsOf = (frame) => motion.slice(frame * about.dofs.length, (frame + 1) * about.dofs.length);
  const networks = in_folder ? await folderNetworks(about, dofsOf) : serverNetworks(about);
  // Plays a motion file from now on.
  async function play(file) {
    if (in_folder) throw new Error('This page has no server, so it reads images only; `doppel view` plays motions.');
    const taken = await (await fetched(`api/motion?${new URLSearchParams({ name: file.name })}`, file)).json();
    motion = await motionRows(taken.motion);
    Object.assign(about, taken, { cuts: [], cameras: false });  // the cameras filmed another motion
  }
  // A sequence without a character: the points of a frame [3K].
  const all_points = about.points ? new Float32Array(await bytesOf('double/points.bin')) : null;
  const points = all_points && ((frame) => all_points.subarray(3 * frame * about.points.length, 3 * (frame + 1) * about.points.length));
  const cameras = about.cameras && !in_folder ? await (await fetched('api/cameras')).json() : { cameras: [], masks: false };
  const picture = async (camera, frame, mask) => createImageBitmap(
    await (await fetched(`api/picture?${new URLSearchParams({ camera, frame, mask: Number(mask) })}`)).blob(),
    { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  const training = about.training && !in_folder ? async () => (await fetched('api/training')).json() : null;
  const trainingImage = (query) => imageAddress('api/training_image', query);
  const texture = about.textured ? imageAddress('double/texture.jpg') : null;
  return { about, mesh, dofsOf, points, play, cameras, picture, training, trainingImage, texture, ...networks, ...(points ? { live: null } : {}) };
}
