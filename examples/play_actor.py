#!/usr/bin/python3
"""Poses an exported Doppel actor from Python, and draws it if it has a dynamic texture. Needs PyTorch and NumPy and nothing of
Doppel.

    play_actor.py actor.pt poseAngles.motion vertices.npy [image.ppm]
"""
import io
import json
import sys

import numpy as np
import torch

SIZE = 512


def look_at(vertices):
    """A camera that looks along -z at the middle of the vertices [N,3]: [1,3,4], pixels from world metres."""
    low, high = vertices.min(0).values, vertices.max(0).values
    K = torch.tensor([[1.3 * SIZE, 0, SIZE / 2], [0, 1.3 * SIZE, SIZE / 2], [0, 0, 1]])
    R = torch.diag(torch.tensor([1.0, -1.0, -1.0]))  # x right, y down
    t = torch.tensor([0.0, 0.0, 1.6 * float((high - low).max())]) - R @ ((low + high) / 2)
    return (K @ torch.cat([R, t[:, None]], 1))[None]


def draw(vertices, texture, projection, faces, uvs, face_uvs):
    """A z-buffer: [SIZE,SIZE,3] bytes. texture [T,T,3], row 0 at v = 1."""
    screen = vertices @ projection[:, :3].T + projection[:, 3]
    depth = np.full((SIZE, SIZE), np.inf)
    image = np.full((SIZE, SIZE, 3), 230, np.uint8)
    for face, face_uv in zip(faces, face_uvs):
        z = screen[face, 2]
        u, v = screen[face, 0] / z, screen[face, 1] / z
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        x0, x1 = max(0, int(np.floor(u.min()))), min(SIZE, int(u.max()) + 1)
        y0, y1 = max(0, int(np.floor(v.min()))), min(SIZE, int(v.max()) + 1)
        if z.min() <= 0 or area == 0 or x0 >= x1 or y0 >= y1:
            continue
        x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
        b = np.stack([(u[i] - x) * (v[j] - y) - (u[j] - x) * (v[i] - y) for i, j in ((1, 2), (2, 0), (0, 1))]) / area
        inside = b.min(0) >= 0
        b = b / z[:, None, None]
        at = 1 / np.where(inside, b.sum(0), 1)
        uv = np.einsum("kyx,kc->yxc", b * at, uvs[face_uv])
        nearer = inside & (at < depth[y0:y1, x0:x1])
        texel = np.clip((uv * [1, -1] + [0, 1]) * len(texture), 0, len(texture) - 1).astype(int)
        depth[y0:y1, x0:x1][nearer] = at[nearer]
        colour = np.clip(texture[texel[..., 1], texel[..., 0]], 0, 1)
        image[y0:y1, x0:x1][nearer] = np.rint(255 * colour[nearer])
    return image


def main():
    actor_path, motion_path, out_path = sys.argv[1:4]
    extra = {"metadata.json": "", "faces.npy": "", "uvs.npy": "", "face_uvs.npy": ""}
    torch.jit.set_fusion_strategy([])  # with the fuser of PyTorch 2.6, the second call does not return
    actor = torch.jit.load(actor_path, _extra_files=extra)
    about = json.loads(extra["metadata.json"])

    dofs = torch.from_numpy(np.loadtxt(motion_path, skiprows=1, ndmin=2)[:, 1:].astype(np.float32))
    with open(motion_path) as motion:
        if "V0.1" in motion.readline():  # the old format has angles of the opposite sign
            dofs[:, 3:] *= -1
    frames = torch.arange(len(dofs))[:, None] + torch.arange(about["window"]) - (about["window"] - 1)
    windows = dofs[frames.clamp(min=0)]  # oldest first; the first frame repeats where history is missing

    with torch.no_grad():
        vertices = torch.cat([actor(window[None]) for window in windows])
        np.save(out_path, vertices.numpy())
        print(f"{about['name']}: {len(vertices)} frames of {about['num_vertices']} vertices, {about['units']}")
        if len(sys.argv) > 4 and not hasattr(actor, "textured"):
            print(f"{about['name']} has no dynamic texture, so {sys.argv[4]} is not drawn")
        elif len(sys.argv) > 4:
            projection = look_at(vertices[-1])
            posed, texture = actor.textured(windows[-1:], projection)
            arrays = [np.load(io.BytesIO(extra[name])) for name in ("faces.npy", "uvs.npy", "face_uvs.npy")]
            image = draw(posed[0].numpy(), texture[0].numpy(), projection[0].numpy(), *arrays)
            with open(sys.argv[4], "wb") as file:
                file.write(b"P6\n%d %d\n255\n" % (SIZE, SIZE) + image.tobytes())


if __name__ == "__main__":
    main()
