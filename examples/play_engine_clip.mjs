// What a program computes to play `doppel animate --format engine-glb` without networks, here for three.js: the weights
// of the corrective shapes, or with --helpers N the transforms of the helper joints, from the rotations and positions of
// the bones, now and a moment ago (docs/animate.md).
//   const gltf = await new GLTFLoader().loadAsync('engine.glb');
//   const clothes = await Correctives.of(gltf);            // or Helpers.of(gltf)
//   const mixer = new AnimationMixer(gltf.scene);
//   mixer.clipAction(gltf.animations[0]).play();           // or anything else that moves the bones
//   mixer.addEventListener('loop', () => clothes.reset());
//   function draw(seconds) { mixer.update(seconds); clothes.update(seconds); renderer.render(scene, camera); }
// `seconds` is the time since the frame before. The animations in the file set weights and helpers too; `update` comes
// later and replaces them. For helpers these keys are nearer to the actor than the function, so the clips of the file
// need no `update`. The world is in metres with y up, and no bone is scaled. A file of --compress needs
// `loader.setMeshoptDecoder(MeshoptDecoder)`.

/** The product of two rotations x y z w. */
const product = ([a, b, c, d], [x, y, z, w]) => [
  d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z];
const inverse = ([x, y, z, w]) => [-x, -y, -z, w];
const turned = (q, [x, y, z]) => product(product(q, [x, y, z, 0]), inverse(q)).slice(0, 3);
/** A rotation as three numbers: twice its imaginary part. */
const vector = ([x, y, z, w]) => [x, y, z].map((value) => (w < 0 ? -2 : 2) * value);

/** A rotation vector, axis times angle, as x y z w. */
function rotation(v) {
  const angle = Math.hypot(...v), share = angle > 0 ? Math.sin(angle / 2) / angle : 0;
  return [...v.map((value) => share * value), Math.cos(angle / 2)];
}

/** Rows of numbers times a vector, plus a vector. */
function affine(offset, rows, z) {
  return Float64Array.from(offset, (sum, k) => {
    for (let i = 0, at = k * z.length; i < z.length; ++i) sum += rows[at + i] * z[i];
    return sum;
  });
}

/** Where the bones are, between two moments. */
function between(a, b, share) {
  return { bones: a.bones.map(({ q, p }, i) => {
    const to = b.bones[i], sign = q.reduce((sum, value, k) => sum + value * to.q[k], 0) < 0 ? -1 : 1;
    const mixed = q.map((value, k) => (1 - share) * value + share * sign * to.q[k]), length = Math.hypot(...mixed);
    return { q: mixed.map((value) => value / length), p: p.map((value, k) => (1 - share) * value + share * to.p[k]) };
  }) };
}

/** A function of the bones: their history, its inputs, and its numbers from 0 to 1. */
class BoneFunction {
  /** @param gltf what GLTFLoader made of the file @param key of `extras` @param option that writes it */
  static async read(gltf, key, option, arrays) {
    const meshes = [];
    gltf.scene.traverse((node) => { if (node.isSkinnedMesh && node.userData[key]) meshes.push(node); });
    if (meshes.length === 0) throw new Error(`the file holds no ${key}; write it with \`doppel animate --format engine-glb${option}\``);
    const f = { ...meshes[0].userData[key] };
    if (f.version !== 1) throw new Error(`the file holds ${key} of version ${f.version}; this script reads version 1`);
    for (const name of ['rest', 'mean', 'scale', 'linear', 'offset', 'hidden', 'hiddenOffset', 'output', ...arrays])
      f[name] = (await gltf.parser.getDependency('accessor', f[name])).array;
    return [meshes[0], f];
  }

  constructor(mesh, f) {
    Object.assign(this, { mesh, f, time: 0, history: [] });
  }

  /** Forgets the past: after a jump to another position or another moment of an animation. */
  reset() {
    this.history = [];
  }

  /** Moves the clothes for the bones as they are now. @param seconds since the last call */
  update(seconds) {
    if (!(seconds >= 0)) throw new Error(`update(${seconds}): give the seconds since the last call, 0 or more`);
    this.time += seconds;
    if (!(seconds > 0)) this.history.pop();  // the same moment again
    this.history.push({ time: this.time, bones: this.bones() });
    const oldest = this.time - (this.f.lags.at(-1) ?? 0);
    while (this.history.length > 2 && this.history[1].time <= oldest) this.history.shift();
    this.apply(this.weights(this.inputs()));
  }

  /** Rotation and position of each bone in the world. */
  bones() {
    return this.mesh.skeleton.bones.slice(0, this.f.parents.length).map((bone) => {
      bone.updateWorldMatrix(true, false);
      const p = bone.position.clone(), q = bone.quaternion.clone();
      bone.matrixWorld.decompose(p, q, bone.scale.clone());
      return { q: q.toArray(), p: p.toArray() };
    });
  }

  /** The bones at an earlier time; before the first call they stood still. */
  past(time) {
    const after = this.history.findIndex((moment) => moment.time >= time);
    if (after <= 0) return this.history.at(after);  // the first, or the last
    const a = this.history[after - 1], b = this.history[after];
    return between(a, b, (time - a.time) / (b.time - a.time));
  }

  inputs() {
    const now = this.history.at(-1).bones, past = this.f.lags.map((lag) => this.past(this.time - lag).bones), x = [];
    now.forEach(({ q, p }, i) => {
      const back = inverse(q), parent = this.f.parents[i];
      if (parent < 0) x.push(...turned(back, [0, 1, 0]));
      else x.push(...vector(product(inverse(this.f.rest.subarray(4 * i, 4 * i + 4)), product(inverse(now[parent].q), q))));
      for (const then of past)
        x.push(...turned(back, then[i].p.map((value, k) => value - p[k])), ...vector(product(back, then[i].q)));
    });
    return x;
  }

  weights(x) {
    const { mean, scale, limit, linear, offset, hidden, hiddenOffset, output } = this.f;
    const z = x.map((value, i) => Math.min(limit, Math.max(-limit, (value - mean[i]) * scale[i])));
    const inner = affine(hiddenOffset, hidden, z).map(Math.tanh);
    return affine(affine(offset, linear, z), output, inner).map((weight) => Math.min(1, Math.max(0, weight)));
  }
}

export class Correctives extends BoneFunction {
  static async of(gltf) {
    return new Correctives(...await BoneFunction.read(gltf, 'correctives', '', []));
  }

  apply(weights) {
    this.mesh.morphTargetInfluences[0] = 1;
    weights.forEach((weight, k) => (this.mesh.morphTargetInfluences[k + 1] = weight));
  }
}

export class Helpers extends BoneFunction {
  static async of(gltf) {
    return new Helpers(...await BoneFunction.read(gltf, 'helpers', ' --helpers N', ['low', 'high']));
  }

  apply(weights) {
    const numbers = Array.from(weights, (share, i) => this.f.low[i] + share * (this.f.high[i] - this.f.low[i]));
    this.mesh.skeleton.bones.slice(this.f.parents.length).forEach((helper, h) => {
      helper.position.fromArray(numbers, 6 * h);
      helper.quaternion.fromArray(rotation(numbers.slice(6 * h + 3, 6 * h + 6)));
      helper.updateMatrixWorld(true);
    });
  }
}
