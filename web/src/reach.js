// Inverse kinematics: the DoFs between the trunk and a joint bring the joint to a target, within their limits. Each
// iteration takes the smallest step (in radians) that minimises |J step - e|^2 + damping |step|^2, where e is the way to
// the target and J has central differences. A DoF that its limit stops is left out.
import { Matrix3, Vector3 } from 'three';

const kIterations = 30, kDifference = 1e-2, kEnough = 1e-4;  // radians, metres

// W J^T (J W J^T + damping I)^-1 e, W = 1 / radians^2
function step(columns, error, free, damping) {
  const normal = new Matrix3().set(damping, 0, 0, 0, damping, 0, 0, 0, damping);
  columns.forEach((column, k) => {
    const weight = 1 / free[k].radians ** 2, v = column.toArray();
    for (let r = 0; r < 3; ++r) for (let c = 0; c < 3; ++c) normal.elements[3 * c + r] += weight * v[r] * v[c];
  });
  const solved = error.clone().applyMatrix3(normal.invert());
  return columns.map((column, k) => column.dot(solved) / free[k].radians ** 2);
}

// @param start DoFs @returns { dofs, distance: metres that are left }
export async function reach(source, start, joint, target) {
  const { dofs: about, joints } = source.about, moved_by = joints[joint].moved_by.filter(({ radians }) => radians > 0);
  const places = async (poses) => {
    const found = await source.joints(Float32Array.from(poses.flatMap((pose) => Array.from(pose))));
    return poses.map((_, p) => new Vector3().fromArray(found, 3 * (p * joints.length + joint)));
  };
  const wayFrom = (place) => new Vector3().subVectors(target, place);
  const bounded = (value, d) => {
    const [low, high] = about[d].limits ?? [-Infinity, Infinity];
    return Math.min(high, Math.max(low, value));
  };

  async function jacobian(pose, free) {
    const poses = free.flatMap(({ dof, radians }) => [1, -1].map((sign) => {
      const other = pose.slice();
      other[dof] += (sign * kDifference) / radians;
      return other;
    }));
    const found = await places(poses);
    return free.map(({ radians }, k) =>
      new Vector3().subVectors(found[2 * k], found[2 * k + 1]).multiplyScalar(radians / (2 * kDifference)));
  }

  let pose = Float64Array.from(start), damping = 1e-3;
  let error = wayFrom((await places([pose]))[0]);
  for (let i = 0; i < kIterations && error.length() > kEnough; ++i) {
    let free = moved_by, columns = await jacobian(pose, free), next, change;
    for (let again = true; again;) {
      change = step(columns, error, free, damping);
      const stopped = free.map(({ dof }, k) => bounded(pose[dof] + change[k], dof) === pose[dof] && change[k] !== 0);
      again = stopped.includes(true);
      free = free.filter((_, k) => !stopped[k]);
      columns = columns.filter((_, k) => !stopped[k]);
    }
    next = pose.slice();
    free.forEach(({ dof }, k) => { next[dof] = bounded(pose[dof] + change[k], dof); });
    const left = wayFrom((await places([next]))[0]);
    if (left.length() < error.length()) {
      if (error.length() - left.length() < 1e-3 * error.length()) i = kIterations;
      [pose, error, damping] = [next, left, Math.max(1e-8, damping / 4)];
    } else damping *= 4;
  }
  return { dofs: Float32Array.from(pose), distance: error.length() };
}
