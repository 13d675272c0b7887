"""Compares what Blender makes of files of `doppel animate --format npy,glb,fbx` with vertices.npy beside them.

    blender --background --factory-startup --python scripts/check_blender.py -- FILE.glb FILE.fbx ...

With report.json beside a file, the output of `doppel animate --json`, its vertices may not be further off than the
report states by more than .5 mm.

With camera.json beside a file, Blender also draws the textured surface without light in the same frames, and its
images are compared with those of `--format png --camera camera.json --light flat --background '#00ff00'`.

Exit code 1: the vertices of a frame are more than 2 mm off on average, one is more than 8 mm off or further than
stated, or an image has an IoU below .99 or a PSNR below 30 dB inside of the silhouette.
"""
import json
import os
import struct
import sys
import tempfile

import bpy
import numpy as np

if not hasattr(np, "bool"):
    np.bool = bool  # Blender 3.4's importer uses a name that NumPy 1.24 has dropped

FRAMES = {".glb": 5, ".fbx": 25}  # that are compared
STATED_LIMIT = 0.5  # millimetres
MEAN_LIMIT, WORST_LIMIT = 2.0, 8.0  # millimetres
COVER_LIMIT, PSNR_LIMIT = 0.99, 30.0  # IoU, decibel


def template_vertices(path):
    """The attribute _VERTEX: the template's vertex of each vertex of the file."""
    data = open(path, "rb").read()
    size = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20:20 + size])
    accessor = gltf["accessors"][gltf["meshes"][0]["primitives"][0]["attributes"]["_VERTEX"]]
    start = 28 + size + gltf["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    times = [gltf["accessors"][s["input"]]["max"][0] for s in gltf["animations"][0]["samplers"]]
    return np.frombuffer(data, "<f4", accessor["count"], start).astype(int), max(times)


def open_glb(path):
    """The template's vertex of each vertex in Blender, and the time of a share of the clip in Blender's frames."""
    bpy.ops.import_scene.gltf(filepath=path, merge_vertices=False)
    index, duration = template_vertices(path)
    render = bpy.context.scene.render
    return index, lambda share: duration * share * render.fps / render.fps_base


def open_fbx(path):
    """As open_glb. The vertices of an .fbx are those of the template."""
    bpy.ops.import_scene.fbx(filepath=path)
    start, end = bpy.data.actions[0].frame_range
    for action in bpy.data.actions:
        start, end = min(start, action.frame_range[0]), max(end, action.frame_range[1])
    return slice(None), lambda share: start + (end - start) * share


def stated_error(path):
    """The largest distance that the report beside a file states, mm; nothing without a report."""
    report = os.path.join(os.path.dirname(path), "report.json")
    if not os.path.exists(report):
        return np.inf
    return json.load(open(report))[os.path.splitext(path)[1][1:]]["worst_error_mm"]


def posed_vertices(figure):
    """World positions in the axes of glTF (y up)."""
    evaluated = figure.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    points = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    points = np.c_[points.reshape(-1, 3), np.ones(len(points) // 3)] @ np.array(evaluated.matrix_world).T
    return np.c_[points[:, 0], points[:, 2], -points[:, 1]]


def show_texture_alone(figure):
    """The surface shines with the colours of its texture, so that no light counts."""
    for material in figure.data.materials:
        tree = material.node_tree
        image = next((node for node in tree.nodes if node.type == "TEX_IMAGE"), None)
        if image is None:
            return False
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(image.outputs["Color"], emission.inputs["Color"])
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return True


def set_camera(scene, view):
    """The camera of camera.json: its principal point is in the middle and its pixels are square."""
    to_blender = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up
    turn, shift = np.array(view["R"]).reshape(3, 3), np.array(view["t"])
    world = np.eye(4)
    world[:3, :3] = to_blender @ turn.T @ np.diag([1, -1, -1])  # a camera of Blender looks along its -z
    world[:3, 3] = to_blender @ -turn.T @ shift
    data = bpy.data.cameras.new("view")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = view["K"][0] * data.sensor_width / view["width"]
    camera = bpy.data.objects.new("view", data)
    camera.matrix_world = world.T.tolist()
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = view["width"], view["height"]
    scene.render.resolution_percentage = 100


def set_renderer(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 16, False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"


def pixels_of(path):
    """[H, W, 4], the stored values, 0 to 1."""
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    values = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return values


def inner(mask):
    """The pixels whose eight neighbours are in the mask too."""
    height, width = mask.shape
    padded = np.pad(mask, 1)
    shifted = [padded[y:y + height, x:x + width] for y in range(3) for x in range(3)]
    return np.logical_and.reduce(shifted)


def difference(scene, ours_path):
    """IoU of the silhouettes, and PSNR of the colours inside both, in dB."""
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "theirs.png")
        bpy.ops.render.render(write_still=True)
        theirs = pixels_of(scene.render.filepath)
    ours = pixels_of(ours_path)
    here, there = ours[..., 1] - np.maximum(ours[..., 0], ours[..., 2]) < 0.5, theirs[..., 3] > 0.5
    both = inner(here & there)
    error = np.mean((ours[both][:, :3] - theirs[both][:, :3]) ** 2)
    return (here & there).sum() / (here | there).sum(), -10 * np.log10(max(error, 1e-12))


def check(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    kind = os.path.splitext(path)[1]
    index, time_of = open_fbx(path) if kind == ".fbx" else open_glb(path)
    figure = next(item for item in bpy.data.objects
                  if item.type == "MESH" and any(m.type == "ARMATURE" for m in item.modifiers))
    ground_truth = np.load(os.path.join(os.path.dirname(path), "vertices.npy"))
    scene = bpy.context.scene
    mean, worst, cover, psnr = 0.0, 0.0, 1.0, np.inf
    camera_file = os.path.join(os.path.dirname(path), "camera.json")
    images = os.path.exists(camera_file) and show_texture_alone(figure)
    if images:
        set_camera(scene, json.load(open(camera_file))["cam0"])
        set_renderer(scene)
    last = len(ground_truth) - 1
    frames = sorted({round(i * last / (FRAMES[kind] - 1)) for i in range(FRAMES[kind])})
    for i, frame in enumerate(frames):
        time = time_of(frame / last)
        scene.frame_set(int(time), subframe=time - int(time))
        off = 1000 * np.linalg.norm(posed_vertices(figure) - ground_truth[frame][index], axis=1)
        mean, worst = max(mean, off.mean()), max(worst, off.max())
        if images and i % max(len(frames) // 4, 1) == 0:
            found = difference(scene, os.path.join(os.path.dirname(path), f"camera_0_{frame:06d}.png"))
            cover, psnr = min(cover, found[0]), min(psnr, found[1])
    stated = stated_error(path)
    print(f"{path}: Blender {bpy.app.version_string}: {mean:.3f} mm off on average, {worst:.2f} mm at most"
          f"{'' if stated == np.inf else f'; {stated:.2f} mm are stated'}")
    if images:
        print(f"{path}: worst image: IoU {cover:.4f}, PSNR {psnr:.1f} dB inside of the silhouette")
    if mean > MEAN_LIMIT or worst > min(WORST_LIMIT, stated + STATED_LIMIT):
        return False
    return cover >= COVER_LIMIT and psnr >= PSNR_LIMIT


if __name__ == "__main__":
    files = [os.path.abspath(name) for name in sys.argv[sys.argv.index("--") + 1:]]
    sys.exit(0 if all([check(name) for name in files]) else 1)
