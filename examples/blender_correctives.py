"""Moves the clothes of a file of `doppel animate --format engine-glb` in Blender, for any motion of its bones: by the
weights of its corrective shapes, or with --helpers N by its helper joints.

    blender --background --python examples/blender_correctives.py -- engine.glb OUT.blend

imports the file, computes weights or helpers for each frame of the scene from the bones, inserts them as keys, and
prints how far they are from those of the animation in the file. In a scene of yours, after you imported the file and
animated its armature: run this script in the text editor, then
`bake(bpy.data.objects["FIGURE"], read_function("engine.glb"))`. The scene is in metres. docs/animate.md has the formula.
The keys of helpers in the file are nearer to the actor than the function, so the clips of such a file need no `bake`.
"""
import json
import os
import struct
import sys

import bpy
import numpy as np
from mathutils import Matrix

if not hasattr(np, "bool"):
    np.bool = bool  # Blender 3.4's importer uses a name that NumPy 1.24 has dropped

TO_BLENDER = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])  # from y up to z up
TYPES = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read_function(path):
    """The function in the extras of the mesh, with the names and the bind matrices of its bones."""
    data = open(path, "rb").read()
    size = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20:20 + size])

    def array(index):
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        start = 28 + size + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = WIDTHS[accessor["type"]]
        return np.frombuffer(data, TYPES[accessor["componentType"]], accessor["count"] * width, start).reshape(-1, width)

    extras = gltf["meshes"][0].get("extras", {})
    function = dict(extras.get("correctives") or extras.get("helpers") or {})
    if function.get("version") != 1:
        sys.exit(f"{path} holds no correctives or helpers of version 1; write it with `doppel animate --format "
                 "engine-glb`")
    ranges = ("low", "high") if "helpers" in extras else ()
    for name in ("mean", "scale", "linear", "offset", "hidden", "hiddenOffset", "output", *ranges):
        function[name] = array(function[name]).ravel().astype(float)
    for matrix, rows in (("linear", "offset"), ("hidden", "hiddenOffset"), ("output", "offset")):
        function[matrix] = function[matrix].reshape(len(function[rows]), -1)
    function["rest"] = array(function["rest"]).astype(float)
    skin = gltf["skins"][0]
    names = [gltf["nodes"][node]["name"] for node in skin["joints"]]
    bones = len(function["parents"])
    function["bones"], function["helpers"] = names[:bones], names[bones:]
    inverse = array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    function["bind"] = dict(zip(names, np.linalg.inv(inverse.astype(float))))
    return function


def joint_matrices(armature, function, names):
    """[J, 4, 4] joints to world in the axes of glTF. Blender turns the axes of bones, but moves vertices alike."""
    world, matrices = np.array(armature.matrix_world), []
    for name in names:
        bone = armature.pose.bones[name]
        moved = world @ np.array(bone.matrix) @ np.linalg.inv(np.array(bone.bone.matrix_local))
        matrices.append(TO_BLENDER.T @ moved @ TO_BLENDER @ function["bind"][name])
    return np.array(matrices)


def move_joint(armature, function, name, matrix):
    """Moves a joint to a matrix of `joint_matrices`."""
    bone = armature.pose.bones[name]
    moved = TO_BLENDER @ matrix @ np.linalg.inv(function["bind"][name]) @ TO_BLENDER.T
    in_armature = np.linalg.inv(np.array(armature.matrix_world)) @ moved @ np.array(bone.bone.matrix_local)
    bone.matrix = Matrix(in_armature.tolist())


def rotation(v):
    """The matrix of a rotation vector, axis times angle."""
    angle = np.linalg.norm(v)
    return np.array(Matrix.Rotation(angle, 3, v / angle if angle > 0 else (1, 0, 0)))


def quaternion(matrix):
    """x y z w of a rotation matrix."""
    w, x, y, z = Matrix(matrix.tolist()).to_quaternion()
    return np.array([x, y, z, w])


def product(a, b):
    return np.r_[a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3]]


def inverse(q):
    return q * [-1, -1, -1, 1]


def vector(q):
    """A rotation as three numbers: twice its imaginary part."""
    return (-2 if q[3] < 0 else 2) * q[:3]


class BoneFunction:
    """The numbers from 0 to 1 of the function, from frame to frame."""

    def __init__(self, function):
        self.function, self.history = function, []  # (seconds, rotations, positions)

    def update(self, seconds, matrices):
        turns, points = np.array([quaternion(m[:3, :3]) for m in matrices]), matrices[:, :3, 3]
        self.history.append((seconds, turns, points))
        lags = self.function["lags"]
        while len(self.history) > 2 and lags and self.history[1][0] <= seconds - lags[-1]:
            del self.history[0]
        past = [self.past(seconds - lag) for lag in lags]
        return self.weights(self.inputs(turns, points, matrices, past))

    def past(self, seconds):
        """The bones at an earlier time; before the first frame they stood still."""
        after = next(i for i, moment in enumerate(self.history) if moment[0] >= seconds)
        if after == 0:
            return self.history[0][1:]
        (t0, turns0, points0), (t1, turns1, points1) = self.history[after - 1:after + 1]
        share = (seconds - t0) / (t1 - t0)
        sign = np.where(np.sum(turns0 * turns1, axis=1, keepdims=True) < 0, -1, 1)
        turns = (1 - share) * turns0 + share * sign * turns1
        return turns / np.linalg.norm(turns, axis=1, keepdims=True), (1 - share) * points0 + share * points1

    def inputs(self, turns, points, matrices, past):
        x = []
        for i, parent in enumerate(self.function["parents"]):
            back = inverse(turns[i])
            if parent < 0:
                x.append(matrices[i, 1, :3])  # R^T (0, 1, 0)
            else:
                x.append(vector(product(inverse(self.function["rest"][i]), product(inverse(turns[parent]), turns[i]))))
            for old_turns, old_points in past:
                x += [matrices[i, :3, :3].T @ (old_points[i] - points[i]), vector(product(back, old_turns[i]))]
        return np.concatenate(x)

    def weights(self, x):
        f = self.function
        z = np.clip((x - f["mean"]) * f["scale"], -f["limit"], f["limit"])
        inner = np.tanh(f["hiddenOffset"] + f["hidden"] @ z)
        return np.clip(f["offset"] + f["linear"] @ z + f["output"] @ inner, 0, 1)


def set_shapes(figure, weights, frame):
    blocks = figure.data.shape_keys.key_blocks
    for k, weight in enumerate([1.0, *weights]):
        blocks[k + 1].value = weight  # block 0 is the shape at rest
        blocks[k + 1].keyframe_insert("value", frame=frame)


def set_helpers(armature, function, shares, bones, frame):
    numbers = function["low"] + shares * (function["high"] - function["low"])
    for name, helper in zip(function["helpers"], numbers.reshape(-1, 6)):
        bone, local = armature.pose.bones[name], np.eye(4)
        local[:3, 3], local[:3, :3] = helper[:3], rotation(helper[3:])
        move_joint(armature, function, name, bones[function["bones"].index(bone.parent.name)] @ local)
        for path in ("location", "rotation_quaternion"):
            bone.keyframe_insert(path, frame=frame)


def bake(figure, function):
    """Inserts keys of the shapes or of the helpers for each frame of the scene."""
    scene = bpy.context.scene
    armature = armature_of(figure)
    if not function["helpers"]:
        figure.data.shape_keys.animation_data_clear()
    state = BoneFunction(function)
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        bones = joint_matrices(armature, function, function["bones"])
        numbers = state.update(frame * scene.render.fps_base / scene.render.fps, bones)
        if function["helpers"]:
            set_helpers(armature, function, numbers, bones, frame)
        else:
            set_shapes(figure, numbers, frame)


def armature_of(figure):
    return next(modifier.object for modifier in figure.modifiers if modifier.type == "ARMATURE")


def keys(figure, function):
    """For each frame of the scene the weights of the shapes, or the positions of the helpers in millimetres."""
    scene, found = bpy.context.scene, []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        if function["helpers"]:
            found.append(1000 * joint_matrices(armature_of(figure), function, function["helpers"])[:, :3, 3])
        else:
            found.append([block.value for block in figure.data.shape_keys.key_blocks[2:]])
    return np.array(found)


def main(source, target):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 25
    bpy.ops.import_scene.gltf(filepath=source, merge_vertices=False)
    function = read_function(source)
    figure = next(item for item in bpy.data.objects if item.type == "MESH" and item.vertex_groups)
    scene = bpy.context.scene
    actions = [action.frame_range for action in bpy.data.actions]
    scene.frame_start = round(min(start for start, _ in actions))
    scene.frame_end = round(max(end for _, end in actions))
    stored = keys(figure, function)
    bake(figure, function)
    off = np.abs(keys(figure, function) - stored)
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(target))
    what = "helpers: positions in millimetres" if function["helpers"] else "shapes: weights"
    print(f"{len(stored)} frames, {stored.shape[1]} {what} differ from those of the file by {off.mean():.4f} on average, "
          f"{off.max():.4f} at most")


if __name__ == "__main__" and "--" in sys.argv:
    arguments = sys.argv[sys.argv.index("--") + 1:]
    if len(arguments) != 2:
        sys.exit("usage: blender --background --python blender_correctives.py -- engine.glb OUT.blend")
    main(*arguments)
