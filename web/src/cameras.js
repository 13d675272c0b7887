// The cameras of a capture: small frusta in the scene, and the picture of one of them behind the double.
import {
  BufferGeometry, DoubleSide, Float32BufferAttribute, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial,
  SRGBColorSpace, Texture, Vector3,
} from 'three';

const kFrustum = 0.15, kBehind = 1.5;  // metres: depth of a frustum; from the double to the picture

// The world point of a pixel at a depth: R^T (depth K^-1 (u, v, 1) - t)
function pointOf({ K, R, t }, u, v, depth) {
  const y = (v - K[1][2]) / K[1][1], x = (u - K[0][2] - K[0][1] * y) / K[0][0];
  const seen = [x * depth - t[0], y * depth - t[1], depth - t[2]];
  return new Vector3(...[0, 1, 2].map((c) => R[0][c] * seen[0] + R[1][c] * seen[1] + R[2][c] * seen[2]));
}
const corners = (camera, depth) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => pointOf(camera, u * camera.width, v * camera.height, depth));
export const centreOf = (camera) => pointOf(camera, 0, 0, 0);

function frusta(cameras) {
  const lines = [];
  for (const camera of cameras) {
    const centre = centreOf(camera), far = corners(camera, kFrustum);
    far.forEach((corner, k) => lines.push(centre, corner, corner, far[(k + 1) % 4]));
  }
  const geometry = new BufferGeometry().setFromPoints(lines);
  return new LineSegments(geometry, new LineBasicMaterial({ color: 0x3d8bfd }));
}

export class Cameras {
  constructor(scene, cameras) {
    this.cameras = cameras;
    this.lines = frusta(cameras);
    this.lines.frustumCulled = false;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(new Float32Array(12), 3));
    geometry.setAttribute('uv', new Float32BufferAttribute([0, 0, 1, 0, 1, 1, 0, 1], 2));  // the picture's first row is at v = 0
    geometry.setIndex([0, 2, 1, 0, 3, 2]);
    this.sheet = new Mesh(geometry, new MeshBasicMaterial({ side: DoubleSide, depthWrite: false }));
    this.sheet.frustumCulled = false;
    this.sheet.renderOrder = -1;
    this.sheet.visible = false;
    scene.add(this.lines, this.sheet);
  }

  // Shows a picture, an ImageBitmap, behind the point `target`.
  project(index, image, target) {
    const camera = this.cameras[index], axis = camera.R[2];
    const depth = axis[0] * target.x + axis[1] * target.y + axis[2] * target.z + camera.t[2];
    const position = this.sheet.geometry.getAttribute('position');
    corners(camera, Math.max(1, depth) + kBehind).forEach((point, k) => position.setXYZ(k, point.x, point.y, point.z));
    position.needsUpdate = true;
    this.sheet.material.map?.dispose();
    this.sheet.material.map = Object.assign(new Texture(image), { colorSpace: SRGBColorSpace, flipY: false, needsUpdate: true });
    this.sheet.material.needsUpdate = true;
    this.sheet.visible = true;
  }

  hide() { this.sheet.visible = false; }

  // Puts the camera of the page at that of the capture. The whole picture is in view.
  lookThrough(index, view) {
    const camera = this.cameras[index], { K, R, width, height } = camera;
    view.position.copy(centreOf(camera));
    view.up.set(-R[1][0], -R[1][1], -R[1][2]);
    view.lookAt(pointOf(camera, K[0][2], K[1][2], 1));
    const tall = Math.max(K[1][2], height - K[1][2]) / K[1][1], wide = Math.max(K[0][2], width - K[0][2]) / K[0][0];
    view.fov = (360 / Math.PI) * Math.atan(Math.max(tall, wide / view.aspect));
    view.updateProjectionMatrix();
  }
}
