"""Compares what Blender makes of .glb files of `doppel animate --format npy,glb` with vertices.npy beside them.

    blender --background --factory-startup --python scripts/check_blender.py -- FILE.glb ...

Exit code 1: the vertices of a frame are more than 2 mm off on average, or one is more than 8 mm off.
"""
import json
import os
import struct
import sys

import bpy
import numpy as np

if not hasattr(np, "bool"):
    np.bool = bool  # Blender 3.4's importer uses a name that NumPy 1.24 has dropped

FRAMES = 5
MEAN_LIMIT, WORST_LIMIT = 2.0, 8.0  # millimetres


def template_vertices(path):
    """The attribute _VERTEX: the template's vertex of each vertex of the file."""
    data = open(path, "rb").read()
    size = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20:20 + size])
    accessor = gltf["accessors"][gltf["meshes"][0]["primitives"][0]["attributes"]["_VERTEX"]]
    start = 28 + size + gltf["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    times = [gltf["accessors"][s["input"]]["max"][0] for s in gltf["animations"][0]["samplers"]]
    return np.frombuffer(data, "<f4", accessor["count"], start).astype(int), max(times)


def posed_vertices(figure):
    """World positions in the axes of glTF (y up)."""
    evaluated = figure.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    points = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    points = np.c_[points.reshape(-1, 3), np.ones(len(points) // 3)] @ np.array(evaluated.matrix_world).T
    return np.c_[points[:, 0], points[:, 2], -points[:, 1]]


def check(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path, merge_vertices=False)
    figure = next(item for item in bpy.data.objects
                  if item.type == "MESH" and any(m.type == "ARMATURE" for m in item.modifiers))
    truth = np.load(os.path.join(os.path.dirname(path), "vertices.npy"))
    index, duration = template_vertices(path)
    scene = bpy.context.scene
    mean, worst = 0.0, 0.0
    for i in range(FRAMES):
        frame = round(i * (len(truth) - 1) / (FRAMES - 1))
        time = duration * frame / (len(truth) - 1) * scene.render.fps / scene.render.fps_base
        scene.frame_set(int(time), subframe=time - int(time))
        off = 1000 * np.linalg.norm(posed_vertices(figure) - truth[frame][index], axis=1)
        mean, worst = max(mean, off.mean()), max(worst, off.max())
    print(f"{path}: Blender {bpy.app.version_string}: {mean:.3f} mm off on average, {worst:.2f} mm at most")
    return mean <= MEAN_LIMIT and worst <= WORST_LIMIT


if __name__ == "__main__":
    files = [os.path.abspath(name) for name in sys.argv[sys.argv.index("--") + 1:]]
    sys.exit(0 if all([check(name) for name in files]) else 1)
