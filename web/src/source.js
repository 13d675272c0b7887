// The double as the server gives it: sizes, mesh, motion and geometry of poses.
const address = (path, query = {}) => `${path}?${new URLSearchParams(query)}`;

async function fetched(path, query, body) {
  const response = await fetch(address(path, query), body ? { method: 'POST', body } : {});
  if (!response.ok) throw new Error(`${path}: ${await response.text()}`);
  return response;
}

export async function open() {
  const about = await (await fetched('/api/description')).json();
  const bytes = await (await fetched('/api/mesh')).arrayBuffer();
  const [corners, split] = new Uint32Array(bytes, 0, 2);
  const mesh = {
    corners: new Uint32Array(bytes, 8, corners),
    source: new Uint32Array(bytes, 8 + 4 * corners, split),
    uvs: new Float32Array(bytes, 8 + 4 * (corners + split), 2 * split),
  };
  const motion = new Float32Array(await (await fetched('/api/motion')).arrayBuffer());
  const geometry = (buffer) => ({
    vertices: new Float32Array(buffer, 0, 3 * about.vertices),
    joints: new Float32Array(buffer, 12 * about.vertices),
  });
  return {
    about, mesh,
    texture: about.textured ? '/api/texture' : null,
    dofsOf: (frame) => motion.slice(frame * about.dofs.length, (frame + 1) * about.dofs.length),
    frame: async (i, stage) => geometry(await (await fetched('/api/frame', { i, stage })).arrayBuffer()),
    pose: async (dofs, stage) => geometry(await (await fetched('/api/pose', { stage }, dofs)).arrayBuffer()),
    reach: async (dofs, joint, { x, y, z }) => {
      const found = new Float32Array(await (await fetched('/api/reach', { joint, x, y, z }, dofs)).arrayBuffer());
      return { dofs: found.slice(0, -1), distance: found.at(-1) };
    },
  };
}
