// The person's points in space: a dot for each point, and sticks between neighbours on the body.
import {
  BufferGeometry, Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, MeshBasicMaterial,
  SphereGeometry, Vector3,
} from 'three';

const kDot = 0.015;  // metres

export class Figure {
  // @param about names of the points [K], and `sticks`: pairs of points
  constructor({ points, sticks }) {
    const style = { color: 0xff8a1f, depthTest: false, transparent: true };
    this.sticks = sticks;
    this.dots = new InstancedMesh(new SphereGeometry(kDot, 12, 8), new MeshBasicMaterial(style), points.length);
    this.lines = new LineSegments(new BufferGeometry(), new LineBasicMaterial(style));
    this.lines.geometry.setAttribute('position', new Float32BufferAttribute(new Float32Array(6 * sticks.length), 3));
    for (const part of [this.dots, this.lines]) Object.assign(part, { frustumCulled: false, renderOrder: 1 });
    this.group = new Group().add(this.dots, this.lines);
    this.found = [];  // the positions that are shown
  }

  // @param positions [3K], NaN: not found
  show(positions) {
    const at = (k) => new Vector3().fromArray(positions, 3 * k), known = (k) => !Number.isNaN(positions[3 * k]);
    const matrix = new Matrix4();
    this.found = [];
    for (let k = 0; k < this.dots.instanceMatrix.count; ++k)
      if (known(k)) {
        const place = at(k);
        this.dots.setMatrixAt(this.found.length, matrix.makeTranslation(place));
        this.found.push(place);
      }
    this.dots.count = this.found.length;
    this.dots.instanceMatrix.needsUpdate = true;
    const ends = this.lines.geometry.getAttribute('position'), drawn = this.sticks.filter(([a, b]) => known(a) && known(b)).flat();
    drawn.forEach((k, i) => ends.setXYZ(i, ...at(k).toArray()));
    ends.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, drawn.length);
  }

  // The middle of the shown points; null without.
  middle() {
    if (!this.found.length) return null;
    return this.found.reduce((sum, place) => sum.add(place), new Vector3()).divideScalar(this.found.length);
  }
}
