// The surface of one stage.
import {
  BufferAttribute, BufferGeometry, DataTexture, Mesh, MeshBasicMaterial, MeshStandardMaterial, SRGBColorSpace, Vector3,
} from 'three';

export class Body {
  // @param size texels along a side of the dynamic texture; 0: the stage has none
  constructor(mesh, size) {
    const geometry = new BufferGeometry(), split = mesh.source.length;
    geometry.setIndex(new BufferAttribute(mesh.corners, 1));
    this.positions = new BufferAttribute(new Float32Array(3 * split), 3);
    this.normals = new BufferAttribute(new Float32Array(3 * split), 3);
    geometry.setAttribute('position', this.positions);
    geometry.setAttribute('normal', this.normals);
    geometry.setAttribute('uv', new BufferAttribute(mesh.uvs, 2));
    this.topology = mesh;
    // A dynamic texture holds the light.
    this.material = size ? new MeshBasicMaterial() : new MeshStandardMaterial({ color: 0xb8b4ae, roughness: 0.9 });
    if (size) {
      this.texture = new DataTexture(new Uint8Array(4 * size * size), size, size);
      this.texture.colorSpace = SRGBColorSpace;
      this.texture.flipY = true;  // row 0 is at v = 1
      this.material.map = this.texture;
    }
    this.mesh = new Mesh(geometry, this.material);
    this.mesh.frustumCulled = false;
  }

  // @param map the template's texture, or null; a dynamic texture stays
  paint(map) {
    if (this.texture) return;
    this.material.map = map;
    this.material.color.set(map ? 0xffffff : 0xb8b4ae);
    this.material.needsUpdate = true;
  }

  // @param opacity 0..1
  fade(opacity) {
    Object.assign(this.material, { opacity, transparent: opacity < 1 });
    this.material.needsUpdate = true;
  }

  // @param vertices of the template [3N]  @param texels RGBA bytes of the dynamic texture, or null
  show({ vertices, texels }) {
    const { source } = this.topology, normals = this.vertexNormals(vertices);
    for (const [attribute, values] of [[this.positions, vertices], [this.normals, normals]]) {
      for (let i = 0; i < source.length; ++i) attribute.array.set(values.subarray(3 * source[i], 3 * source[i] + 3), 3 * i);
      attribute.needsUpdate = true;
    }
    if (!texels) return;
    this.texture.image.data.set(texels);
    this.texture.needsUpdate = true;
  }

  box() {
    this.mesh.geometry.computeBoundingBox();
    return this.mesh.geometry.boundingBox;
  }

  // Area-weighted normals of the template's vertices, smooth across the seams of the texture; the shader normalises.
  vertexNormals(vertices) {
    const { corners, source } = this.topology, normals = new Float32Array(vertices.length);
    const [a, b, c, n] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
    for (let f = 0; f < corners.length; f += 3) {
      const face = [source[corners[f]], source[corners[f + 1]], source[corners[f + 2]]];
      [a, b, c].forEach((point, k) => point.fromArray(vertices, 3 * face[k]));
      n.crossVectors(b.sub(a), c.sub(a));
      for (const v of face) { normals[3 * v] += n.x; normals[3 * v + 1] += n.y; normals[3 * v + 2] += n.z; }
    }
    return normals;
  }
}
