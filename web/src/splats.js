// The Gaussians of one stage, by the definition of `draw_splats` (docs/layers/splats.md), so that a pixel gets the colour
// that the rasterizer of the training would draw.
import {
  Box3, BufferAttribute, BufferGeometry, DataTexture, FloatType, FramebufferTexture, GLSL3, InstancedBufferAttribute,
  InstancedBufferGeometry, Mesh, RawShaderMaterial, RGFormat, Vector2, Vector3,
} from 'three';

const kPairs = 7, kAcross = 256;  // texels of a Gaussian, two of its 14 numbers each; Gaussians in a row of the texture
const kKeys = 1 << 16;
const kCorners = new BufferAttribute(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2);

// With the factors of the definition, the Gaussian is a circle: alpha = 2^(exponent - |W (pixel - centre)|^2), where
// W = (a b, 0 c). The quad is the square around the circle where alpha is 1/255. Pixels get all numbers as they are:
// interpolation along the quad would add the error of corners that graphics cards round to a fraction of a pixel.
const kVertexShader = `
  precision highp float;
  precision highp int;
  precision highp sampler2D;
  uniform mat4 modelViewMatrix, projectionMatrix;
  uniform vec2 size;  // of the image, pixels
  uniform sampler2D rows;
  in vec2 corner;  // of the quad, -1 or 1
  in uint index;
  flat out vec2 centre;  // pixels
  flat out vec3 factors;  // a b c
  flat out float exponent;
  flat out vec3 colour;

  vec2 pair(int k) {
    return texelFetch(rows, ivec2(${kPairs} * int(index % ${kAcross}u) + k, int(index / ${kAcross}u)), 0).xy;
  }

  void main() {
    vec4 position = vec4(pair(0), pair(1).x, 1), q = vec4(pair(1).y, pair(2), pair(3).x);  // q: w x y z
    vec3 deviations = vec3(pair(3).y, pair(4));
    colour = vec3(pair(5).y, pair(6));
    exponent = log2(max(pair(5).x, 1e-6));

    // Rows of the projection to pixels from the middle of the image. The Jacobian is taken at most 15 % outside of it.
    mat4 m = transpose(projectionMatrix * modelViewMatrix);
    m[0] *= size.x / 2.0;
    m[1] *= size.y / 2.0;
    float depth = dot(m[3], position);
    vec2 middle = vec2(dot(m[0], position), dot(m[1], position)) / depth, limited = clamp(middle, -0.65 * size, 0.65 * size);
    centre = middle + size / 2.0;
    vec3 two = 2.0 * q.yzw, w = q.x * two, x = q.y * two, y = q.z * two;
    float zz = q.w * two.z;
    mat3 spread = mat3(deviations.x * vec3(1.0 - y.y - zz, x.y + w.z, x.z - w.y),
      deviations.y * vec3(x.y - w.z, 1.0 - x.x - zz, y.z + w.x), deviations.z * vec3(x.z + w.y, y.z - w.x, 1.0 - x.x - y.y));
    vec3 across = (m[0].xyz - limited.x * m[3].xyz) * spread / depth;
    vec3 along = (m[1].xyz - limited.y * m[3].xyz) * spread / depth;

    // The determinant of the covariance as a sum of squares keeps thin Gaussians (docs/layers/splats.md).
    const float blur = 0.3, kappa = 0.72134752;  // log2(e) / 2
    float xx = dot(across, across), yy = dot(along, along), xy = dot(across, along);
    vec3 area = cross(across, along);
    float determinant = dot(area, area) + blur * (xx + yy) + blur * blur;
    yy += blur;
    factors.x = sqrt(kappa * yy / determinant);
    factors.y = -factors.x * xy / yy;
    factors.z = sqrt(kappa / yy);

    float reach = exponent + log2(255.0);
    vec2 edge = sqrt(max(reach, 0.0)) * corner, offset;
    offset.y = edge.y / factors.z;
    offset.x = (edge.x - factors.y * offset.y) / factors.x;
    bool drawn = depth >= 0.01 && reach >= 0.0 && determinant < 1e30;
    gl_Position = drawn ? vec4(2.0 * (middle + offset) / size, dot(m[2], position) / depth, 1) : vec4(2, 2, 2, 1);
  }`;

// Colours are those of the display, so they are written as they are: no light, no encoding, no tone mapping.
const kFragmentShader = `
  precision highp float;
  flat in vec2 centre;
  flat in vec3 factors;
  flat in float exponent;
  flat in vec3 colour;
  out vec4 pixel;

  void main() {
    vec2 offset = gl_FragCoord.xy - centre;
    float s = dot(factors.xy, offset), r = factors.z * offset.y, alpha = min(0.99, exp2(exponent - s * s - r * r));
    if (alpha < 1.0 / 255.0) discard;
    pixel = vec4(alpha * colour, alpha);
  }`;

const kVeilVertexShader = `
  in vec2 corner;
  void main() { gl_Position = vec4(corner, 0, 1); }`;

const kVeilFragmentShader = `
  precision highp float;
  uniform sampler2D behind;
  uniform float opacity;
  out vec4 pixel;
  void main() { pixel = (1.0 - opacity) * vec4(texelFetch(behind, ivec2(gl_FragCoord.xy), 0).rgb, 1); }`;

const materialOf = (options) => new RawShaderMaterial({
  glslVersion: GLSL3, transparent: true, premultipliedAlpha: true, depthWrite: false, ...options });

export class Splats {
  // @param count P, the number of Gaussians
  constructor(count) {
    const geometry = new InstancedBufferGeometry(), lines = Math.ceil(count / kAcross);
    this.order = new InstancedBufferAttribute(new Uint32Array(count), 1);  // farthest first
    geometry.setAttribute('corner', kCorners);
    geometry.setAttribute('index', this.order);
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    geometry.instanceCount = count;
    this.rows = new DataTexture(new Float32Array(2 * kPairs * kAcross * lines), kPairs * kAcross, lines, RGFormat, FloatType);
    this.material = materialOf({ vertexShader: kVertexShader, fragmentShader: kFragmentShader,
      uniforms: { rows: { value: this.rows }, size: { value: new Vector2() } } });
    this.mesh = new Mesh(geometry, this.material);
    this.mesh.frustumCulled = false;
    this.distances = new Float64Array(count);
    this.keys = new Uint16Array(count);
    this.surface = new Box3();
    this.addVeil();
  }

  // Gaussians that are each half transparent would show those behind them, and still cover. So the double is faded as a
  // whole: what stood behind it is drawn over it.
  addVeil() {
    const geometry = new BufferGeometry().setAttribute('corner', kCorners).setIndex([0, 1, 2, 2, 1, 3]);
    this.veil = new Mesh(geometry, materialOf({ vertexShader: kVeilVertexShader, fragmentShader: kVeilFragmentShader, depthTest: false,
      uniforms: { behind: { value: null }, opacity: { value: 1 } } }));
    Object.assign(this.veil, { frustumCulled: false, visible: false });
    this.mesh.add(this.veil);
    // Before the dots of the joints; after everything else, as the veil covers what is drawn between.
    this.mesh.renderOrder = 0.5;
    this.veil.renderOrder = 0.6;
    this.mesh.onBeforeRender = (renderer) => {
      if (!this.veil.visible) return;
      const { behind } = this.veil.material.uniforms, { x, y } = renderer.getDrawingBufferSize(new Vector2());
      if (behind.value?.image.width !== x || behind.value.image.height !== y) {
        behind.value?.dispose();
        behind.value = new FramebufferTexture(x, y);
      }
      renderer.copyFramebufferToTexture(behind.value);
    };
  }

  paint() {}  // Gaussians have colours of their own

  fade(opacity) {
    this.veil.visible = opacity < 1;
    this.veil.material.uniforms.opacity.value = opacity;
  }

  // @param vertices of the surface that carries the Gaussians [3N]  @param gaussians rows [14P]; one with a number that is
  // not finite is not drawn
  show({ vertices, gaussians }) {
    const { data } = this.rows.image;
    data.set(gaussians);
    for (let at = 0; at < gaussians.length; at += 2 * kPairs) {
      let sum = 0;
      for (let k = 0; k < 2 * kPairs; ++k) sum += data[at + k];
      if (!Number.isFinite(sum)) data.fill(0, at, at + 2 * kPairs);
    }
    this.rows.needsUpdate = true;
    this.surface.setFromArray(vertices);
    this.eye = null;  // sorted from nowhere
  }

  box() { return this.surface; }

  // Sorts the Gaussians by their distance from a camera, farthest first; turning the camera changes no order.
  prepare(renderer, camera) {
    renderer.getDrawingBufferSize(this.material.uniforms.size.value);
    const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld).sub(this.mesh.position);
    if (this.eye?.equals(eye)) return;
    this.eye = eye;
    const { distances, keys, rows: { image: { data } } } = this, { array: order } = this.order;
    let near = Infinity, far = 0;
    for (let i = 0, at = 0; i < order.length; ++i, at += 2 * kPairs) {
      const d = distances[i] = (data[at] - eye.x) ** 2 + (data[at + 1] - eye.y) ** 2 + (data[at + 2] - eye.z) ** 2;
      if (d < near) near = d;
      if (d > far) far = d;
    }
    const begin = new Uint32Array(kKeys + 1), scale = (kKeys - 1) / (far - near || 1);
    for (let i = 0; i < order.length; ++i) {
      keys[i] = (far - distances[i]) * scale;
      ++begin[keys[i] + 1];
    }
    for (let k = 0; k < kKeys; ++k) begin[k + 1] += begin[k];
    for (let i = order.length - 1; i >= 0; --i) order[begin[keys[i]]++] = i;  // of equal keys, the first is in front
    this.order.needsUpdate = true;
  }
}
