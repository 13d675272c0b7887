// The picture: a body, or Gaussians, for each stage in view, handles at the joints, light, camera.
import {
  Box3, Color, DirectionalLight, GridHelper, HemisphereLight, InstancedMesh, Matrix4, MeshBasicMaterial, PerspectiveCamera,
  Plane, Raycaster, Scene, SphereGeometry, SRGBColorSpace, TextureLoader, Vector2, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { Body } from './body.js';
import { Cameras, centreOf } from './cameras.js';
import { Figure } from './figure.js';
import { Splats } from './splats.js';

const kHandle = 0.02;  // metres

function widthOf(box) {
  const size = box.getSize(new Vector3());
  return Math.max(size.x, size.z, size.y / 2);
}

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
    this.bodies = new Map();  // stage name -> Body or Splats
    this.gap = 0;  // metres between bodies side by side
    this.handles = new InstancedMesh(new SphereGeometry(kHandle, 12, 8), new MeshBasicMaterial({ depthTest: false,
      transparent: true, opacity: 0.85 }), source.about.joints.length);
    this.handles.renderOrder = 1;
    this.handles.frustumCulled = false;
    this.scene.add(this.handles);
    this.figure = source.points ? new Figure(source.about) : null;  // without a character
    if (this.figure) this.scene.add(this.figure.group);
    this.through = -1;  // the camera of the capture that the page looks through
    this.opacity = 1;
    this.cameras = new Cameras(this.scene, source.cameras.cameras);
    new ResizeObserver(() => this.resize(parent)).observe(parent);
    this.resize(parent);
    this.scene.onBeforeRender = (renderer, scene, camera) => {
      for (const body of this.bodies.values()) if (body.mesh.visible) body.prepare?.(renderer, camera);
    };
    // A picture is drawn when something has changed: see `redraw`.
    this.renderer.setAnimationLoop(() => {
      if (!(this.through < 0 && this.controls.update()) && !this.changed) return;
      this.changed = false;
      this.renderer.render(this.scene, this.camera);
    });
  }

  redraw() { this.changed = true; }

  addLights() {
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.scene.add(this.sun, new HemisphereLight(0xffffff, 0x777777, 1.6));
    this.grid = new GridHelper(8, 16, 0x888888, 0x888888);
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.25;
    this.scene.add(this.grid);
    const dark = window.matchMedia('(prefers-color-scheme: dark)');
    const paint = () => { this.scene.background = new Color(dark.matches ? 0x15171a : 0xf4f4f2); this.redraw(); };
    dark.addEventListener('change', paint);
    paint();
    this.turnLight(40);
  }

  // @param file an image: the template's texture from now on
  async takeTexture(file) {
    this.source.texture = URL.createObjectURL(file);
    this.image = null;
    await this.useTexture(true);
  }

  async useTexture(wanted) {
    if (wanted && this.source.texture && !this.image) {
      this.image = await new TextureLoader().loadAsync(this.source.texture);
      this.image.colorSpace = SRGBColorSpace;
    }
    this.map = wanted ? this.image ?? null : null;
    for (const body of this.bodies.values()) body.paint(this.map);
    this.redraw();
  }

  // Looks through a camera of the capture, or, with -1, from where the visitor looked before.
  lookThrough(index) {
    if (this.through < 0) this.free = { position: this.camera.position.clone(), fov: this.camera.fov };
    this.through = index;
    this.controls.enabled = index < 0;
    this.cameras.lines.visible = index < 0;
    this.cameras.hide();
    if (index >= 0) this.cameras.lookThrough(index, this.camera);
    else {
      this.camera.position.copy(this.free.position);
      this.camera.fov = this.free.fov;
      this.camera.up.set(0, 1, 0);
      this.camera.updateProjectionMatrix();
      this.controls.update();
    }
    this.redraw();
  }

  // The picture of the camera that the page looks through. @param loading resolves to it
  async project(loading) {
    const index = this.through;
    try {
      const image = await loading;
      if (this.through === index) this.cameras.project(index, image, this.anchor());
    } catch (error) {
      this.hidePicture();  // it shows another frame
      throw error;
    }
    this.redraw();
  }

  hidePicture() { this.cameras.hide(); this.redraw(); }

  hideCameras() {
    if (this.through >= 0) this.lookThrough(-1);
    this.cameras.lines.visible = false;
    this.redraw();
  }

  // @param opacity of the double, 0..1
  fade(opacity) {
    this.opacity = opacity;
    for (const body of this.bodies.values()) body.fade(opacity);
    this.redraw();
  }

  turnLight(degrees) {
    const angle = (degrees * Math.PI) / 180;
    this.sun.position.set(3 * Math.sin(angle), 4, 3 * Math.cos(angle));
    this.redraw();
  }

  // Shows one body for each entry of `surfaces`, { stage, vertices, texels, gaussians }. That of stage `chosen` stands at
  // its place and carries the handles; the others stand beside it.
  show(surfaces, chosen, joints) {
    for (const { stage } of surfaces)
      if (!this.bodies.has(stage.name)) {
        const body = stage.gaussians ? new Splats(stage.gaussians) : new Body(this.source.mesh, stage.texture_size);
        body.paint(this.map);
        body.fade(this.opacity);
        this.bodies.set(stage.name, body);
        this.scene.add(body.mesh);
      }
    for (const body of this.bodies.values()) body.mesh.visible = false;
    const middle = surfaces.findIndex(({ stage }) => stage.name === chosen.name);
    surfaces.forEach((surface, k) => {
      const body = this.bodies.get(surface.stage.name);
      body.show(surface);
      body.mesh.visible = true;
      if (!this.gap) this.gap = 1.1 * widthOf(body.box());
      body.mesh.position.set(this.asideOf(k, middle), 0, 0);
    });
    this.joints = joints;
    const at = new Matrix4();
    for (let j = 0; j < this.source.about.joints.length; ++j)
      this.handles.setMatrixAt(j, at.makeTranslation(joints[3 * j], joints[3 * j + 1], joints[3 * j + 2]));
    this.handles.instanceMatrix.needsUpdate = true;
    this.handles.computeBoundingSphere();
    this.redraw();
  }

  // Shows the person's points. @param positions [3K], NaN: not found
  showPoints(positions) {
    this.figure.show(positions);
    this.redraw();
  }

  // Points the camera at all bodies in view, or at the person's points and all cameras of the capture. While the page
  // looks through a camera of the capture, the visitor's own camera is moved, to which the page returns.
  frameAll() {
    const box = new Box3();
    if (this.figure) box.setFromPoints([...this.figure.found, ...this.source.cameras.cameras.map(centreOf)]);
    for (const body of this.bodies.values()) if (body.mesh.visible) box.union(body.box().clone().translate(body.mesh.position));
    const centre = box.getCenter(new Vector3()), size = box.getSize(new Vector3());
    const fov = this.through < 0 ? this.camera.fov : this.free.fov;
    const wide = size.x / (2 * this.camera.aspect * Math.tan((fov * Math.PI) / 360));
    const distance = Math.max(1.6 * size.y, 1.1 * wide + size.z / 2);
    this.grid.position.y = this.figure ? Math.min(0, ...this.figure.found.map(({ y }) => y)) : box.min.y;
    this.controls.target.copy(centre);
    const position = this.through < 0 ? this.camera.position : this.free.position;
    position.copy(centre).add(new Vector3(0.5 * size.y, 0.15 * size.y, distance));
    if (this.through < 0) this.controls.update();
  }

  // Metres along x from its place to where body `k` stands, if body `chosen` stands at its place.
  asideOf(k, chosen) { return (k - chosen) * this.gap; }

  // Pixels from world metres, row by row [3,4]. @param aside metres along x that what is seen stands beside its place
  projection(aside = 0) {
    this.camera.updateMatrixWorld();
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement, view = this.camera.matrixWorldInverse.elements;
    const focal = height / 2 / Math.tan((this.camera.fov * Math.PI) / 360), rows = [0, 1, 2].map((r) => [0, 1, 2, 3].map(
      (c) => (r ? -1 : 1) * view[4 * c + r]));  // x right, y down, z forward
    for (const row of rows) row[3] += aside * row[0];
    return [rows[0].map((x, c) => focal * x + (width / 2) * rows[2][c]), rows[1].map((y, c) => focal * y + (height / 2) * rows[2][c]),
      rows[2]].flat();
  }

  resize(parent) {
    const { clientWidth: width, clientHeight: height } = parent;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
    if (this.through >= 0) this.cameras.lookThrough(this.through, this.camera);
    this.redraw();
  }

  showHandles(wanted) {
    this.handles.visible = wanted;
    if (this.figure) this.figure.group.visible = wanted;
    this.redraw();
  }

  jointAt(j) { return new Vector3(this.joints[3 * j], this.joints[3 * j + 1], this.joints[3 * j + 2]); }

  // What a picture stands behind: the root of the double, or the middle of the person's points.
  anchor() { return this.figure ? this.figure.middle() ?? this.controls.target : this.jointAt(0); }

  // Pixels of the page -> a ray.
  ray(event) {
    const box = this.renderer.domElement.getBoundingClientRect(), ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height), this.camera);
    return ray;
  }

  // A click beside a camera of the capture: `chosen(index)`.
  onCamera(chosen) {
    const canvas = this.renderer.domElement;
    let pressed = null;
    canvas.addEventListener('pointerdown', (event) => { pressed = event; });
    canvas.addEventListener('click', (event) => {
      const still = pressed && Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) < 4;
      if (!still || !this.cameras.lines.visible) return;
      const { ray } = this.ray(event), away = (camera) => ray.distanceToPoint(centreOf(camera));
      const nearest = this.source.cameras.cameras.map((camera, index) => ({ index, metres: away(camera) })).sort((a, b) => a.metres - b.metres)[0];
      if (nearest?.metres < 0.12) chosen(nearest.index);
    });
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
    canvas.addEventListener('pointerup', () => { joint = -1; this.controls.enabled = this.through < 0; });
  }
}
