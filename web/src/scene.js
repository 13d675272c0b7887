// The picture: the mesh, handles at the joints, light, camera.
import {
  BufferAttribute, BufferGeometry, Color, DirectionalLight, GridHelper, HemisphereLight, InstancedMesh, Matrix4, Mesh,
  MeshBasicMaterial, MeshStandardMaterial, PerspectiveCamera, Plane, Raycaster, Scene, SphereGeometry, SRGBColorSpace,
  TextureLoader, Vector2, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const kHandle = 0.02;  // metres

export class Picture {
  constructor(parent, source) {
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    parent.append(this.renderer.domElement);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(40, 1, 0.05, 100);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.source = source;
    this.addLights();
    this.addMesh();
    this.handles = new InstancedMesh(new SphereGeometry(kHandle, 12, 8), new MeshBasicMaterial({ depthTest: false,
      transparent: true, opacity: 0.85 }), source.about.joints.length);
    this.handles.renderOrder = 1;
    this.handles.frustumCulled = false;
    this.scene.add(this.handles);
    new ResizeObserver(() => this.resize(parent)).observe(parent);
    this.resize(parent);
    this.renderer.setAnimationLoop(() => { this.controls.update(); this.renderer.render(this.scene, this.camera); });
  }

  addLights() {
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.scene.add(this.sun, new HemisphereLight(0xffffff, 0x777777, 1.6));
    this.grid = new GridHelper(8, 16, 0x888888, 0x888888);
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.25;
    this.scene.add(this.grid);
    const dark = window.matchMedia('(prefers-color-scheme: dark)');
    const paint = () => { this.scene.background = new Color(dark.matches ? 0x15171a : 0xf4f4f2); };
    dark.addEventListener('change', paint);
    paint();
    this.turnLight(40);
  }

  addMesh() {
    const { mesh } = this.source, geometry = new BufferGeometry();
    geometry.setIndex(new BufferAttribute(mesh.corners, 1));
    this.positions = new BufferAttribute(new Float32Array(3 * mesh.source.length), 3);
    this.normals = new BufferAttribute(new Float32Array(3 * mesh.source.length), 3);
    geometry.setAttribute('position', this.positions);
    geometry.setAttribute('normal', this.normals);
    geometry.setAttribute('uv', new BufferAttribute(mesh.uvs, 2));
    this.material = new MeshStandardMaterial({ color: 0xb8b4ae, roughness: 0.9 });
    this.body = new Mesh(geometry, this.material);
    this.body.frustumCulled = false;
    this.scene.add(this.body);
  }

  async useTexture(wanted) {
    if (wanted && this.source.texture && !this.image) {
      this.image = await new TextureLoader().loadAsync(this.source.texture);
      this.image.colorSpace = SRGBColorSpace;
    }
    this.material.map = wanted && this.image ? this.image : null;
    this.material.color.set(this.material.map ? 0xffffff : 0xb8b4ae);
    this.material.needsUpdate = true;
  }

  turnLight(degrees) {
    const angle = (degrees * Math.PI) / 180;
    this.sun.position.set(3 * Math.sin(angle), 4, 3 * Math.cos(angle));
  }

  show({ vertices, joints }) {
    const { source } = this.source.mesh, normals = this.vertexNormals(vertices);
    for (const [attribute, values] of [[this.positions, vertices], [this.normals, normals]]) {
      for (let i = 0; i < source.length; ++i) attribute.array.set(values.subarray(3 * source[i], 3 * source[i] + 3), 3 * i);
      attribute.needsUpdate = true;
    }
    this.joints = joints;
    const at = new Matrix4();
    for (let j = 0; j < this.source.about.joints.length; ++j)
      this.handles.setMatrixAt(j, at.makeTranslation(joints[3 * j], joints[3 * j + 1], joints[3 * j + 2]));
    this.handles.instanceMatrix.needsUpdate = true;
    this.handles.computeBoundingSphere();
  }

  // Area-weighted normals of the template's vertices, smooth across the seams of the texture; the shader normalises.
  vertexNormals(vertices) {
    const { corners, source } = this.source.mesh, normals = new Float32Array(vertices.length);
    const [a, b, c, n] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
    for (let f = 0; f < corners.length; f += 3) {
      const face = [source[corners[f]], source[corners[f + 1]], source[corners[f + 2]]];
      [a, b, c].forEach((point, k) => point.fromArray(vertices, 3 * face[k]));
      n.crossVectors(b.sub(a), c.sub(a));
      for (const v of face) { normals[3 * v] += n.x; normals[3 * v + 1] += n.y; normals[3 * v + 2] += n.z; }
    }
    return normals;
  }

  // Points the camera at the mesh.
  frameAll() {
    this.body.geometry.computeBoundingBox();
    const box = this.body.geometry.boundingBox, centre = box.getCenter(new Vector3()), height = box.getSize(new Vector3()).y;
    this.grid.position.y = box.min.y;
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).add(new Vector3(0.5 * height, 0.15 * height, 1.6 * height));
  }

  resize(parent) {
    const { clientWidth: width, clientHeight: height } = parent;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }

  jointAt(j) { return new Vector3(this.joints[3 * j], this.joints[3 * j + 1], this.joints[3 * j + 2]); }

  // Pixels of the page -> a ray.
  ray(event) {
    const box = this.renderer.domElement.getBoundingClientRect(), ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height), this.camera);
    return ray;
  }

  // Dragging a handle: `moved(joint, target)` in the plane through the joint that faces the camera.
  onDrag(moved) {
    const canvas = this.renderer.domElement;
    let joint = -1, plane = null;
    canvas.addEventListener('pointerdown', (event) => {
      const hit = this.handles.visible ? this.ray(event).intersectObject(this.handles)[0] : null;
      if (!hit) return;
      // Several joints share a place; the last one has the most rotations above it.
      const place = this.jointAt(hit.instanceId);
      for (let j = 0; j < this.source.about.joints.length; ++j) if (this.jointAt(j).distanceTo(place) < 1e-4) joint = j;
      plane = new Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Vector3()), place);
      this.controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
    }, { capture: true });
    canvas.addEventListener('pointermove', (event) => {
      const target = joint < 0 ? null : this.ray(event).ray.intersectPlane(plane, new Vector3());
      if (target) moved(joint, target);
    });
    canvas.addEventListener('pointerup', () => { joint = -1; this.controls.enabled = true; });
  }
}
