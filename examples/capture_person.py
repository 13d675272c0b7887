#!/usr/bin/python3
"""Captures a person from one image with an exported Doppel pose file. Needs PyTorch and NumPy and nothing of Doppel.

    capture_person.py pose.pt image.ppm view.txt OUT

image.ppm is what the camera saw without lens distortion, black where the person is not. view.txt holds lines of words and
numbers, in any order:

    intrinsics    9 numbers, row by row
    rotation      9 numbers, row by row: camera from world
    translation   3 numbers: camera from world, metres
    keypoint NAME x y confidence       any number of these; names are the file's landmark_names

Writes OUT.obj, the surface, and OUT.motion, the pose. With a camera and keypoints both are in the world, and OUT.ppm shows
vertices and landmarks over the image; without, the person stands at the origin.
"""
import io
import json
import sys

import numpy as np
import torch


def read_ppm(path):
    """[height,width,3] bytes."""
    with open(path, "rb") as file:
        magic, size, largest = file.readline().strip(), file.readline().split(), file.readline().strip()
        if magic != b"P6" or largest != b"255":
            sys.exit(f"{path} is not a binary PPM image (P6, 255) without comments")
        width, height = map(int, size)
        return np.frombuffer(file.read(), np.uint8, 3 * width * height).reshape(height, width, 3).copy()


def read_view(path):
    """The lines of the file: tensors by name, and keypoints by theirs."""
    shapes = {"intrinsics": (1, 3, 3), "rotation": (1, 3, 3), "translation": (1, 3)}
    view = {"rotation": torch.diag(torch.tensor([1.0, -1.0, -1.0]))[None]}  # a level camera that looks along -z
    keypoints = {}
    for words in map(str.split, open(path)):
        if words and words[0] == "keypoint":
            keypoints[words[1]] = list(map(float, words[2:5]))
        elif words and words[0] in shapes:
            view[words[0]] = torch.tensor(list(map(float, words[1:]))).reshape(shapes[words[0]])
        elif words:
            sys.exit(f"{path}: not understood: {' '.join(words)}")
    return view, keypoints


def window_of(image, keypoints, about):
    """Left, top and side of the square that the network sees: around the keypoints that count, or, with fewer than four, around
    the pixels that are not black."""
    points = np.array([p[:2] for p in keypoints.values() if p[2] >= about["window_confidence"]], np.float32)
    if len(points) < 4:
        y, x = np.nonzero(image.any(2))
        if len(x) == 0:
            sys.exit("the image is black: there is nobody to capture")
        points = np.array([[x.min(), y.min()], [x.max() + 1, y.max() + 1]], np.float32)
    low, high = points.min(0), points.max(0)
    side = (1 + 2 * about["margin"]) * (high - low).max()
    return (*(low + high - side) / 2, side)


def crop(image, left, top, side, size):
    """The window as [1,3,size,size], 0..1: means of evenly spread points, bilinear, black beyond the image."""
    step = side / size
    n = max(1, int(np.ceil(step)))
    offsets = (np.arange(size * n) + 0.5) * step / n - 0.5
    padded = np.pad(image.astype(np.float32) / 255, ((1, 1), (1, 1), (0, 0)))

    def bilinear(values, at, axis):
        low = np.floor(at).astype(int)
        share = (at - low).reshape([-1 if a == axis else 1 for a in range(3)])
        last = values.shape[axis] - 1
        rows = [values.take((low + 1 + i).clip(0, last), axis) for i in (0, 1)]  # 1: the padding, which is black
        return rows[0] * (1 - share) + rows[1] * share

    sampled = bilinear(bilinear(padded, offsets + top, 0), offsets + left, 1)
    means = sampled.reshape(size, n, size, n, 3).mean((1, 3))
    return torch.from_numpy(means.transpose(2, 0, 1)[None].astype(np.float32))


def draw_points(image, points, view, radius, share, colour):
    """Mixes a colour into the pixels around the projections of points [n,3]."""
    pixels = (points @ view["rotation"][0].T + view["translation"][0]) @ view["intrinsics"][0].T
    height, width = image.shape[:2]
    for u, v, z in pixels.tolist():
        if z <= 0:
            continue
        x, y = int(np.floor(u / z)), int(np.floor(v / z))
        part = image[max(0, y - radius) : max(0, y + radius + 1), max(0, x - radius) : max(0, x + radius + 1)]
        part[:] = np.floor((1 - share) * part + share * np.array(colour) + 0.5)


def main():
    pose_path, image_path, view_path, out = sys.argv[1:5]
    extra = {"metadata.json": "", "faces.npy": ""}
    torch.jit.set_fusion_strategy([])  # with the fuser of PyTorch 2.6, the second call does not return
    pose = torch.jit.load(pose_path, _extra_files=extra)
    about = json.loads(extra["metadata.json"])
    if "doppel_pose" not in about:
        sys.exit(f"{pose_path} is not a pose file")
    image = read_ppm(image_path)
    view, keypoints = read_view(view_path)
    person = crop(image, *window_of(image, keypoints, about), about["input_size"])
    placed = bool(keypoints) and "intrinsics" in view and "translation" in view

    with torch.no_grad():
        if placed:
            rows = torch.zeros(1, len(about["landmark_names"]), 3)
            for name, point in keypoints.items():
                rows[0, about["landmark_names"].index(name)] = torch.tensor(point)
            camera = (view["intrinsics"], view["rotation"], view["translation"])
            dofs, landmarks, vertices, valid = pose.placed(person, *camera, rows)
        else:
            dofs, landmarks, vertices = pose(person, view["rotation"])

    faces = np.load(io.BytesIO(extra["faces.npy"])) + 1
    with open(out + ".obj", "w") as file:
        file.writelines("v %.7g %.7g %.7g\n" % tuple(v) for v in vertices[0].tolist())
        file.writelines("f %d %d %d\n" % tuple(f) for f in faces.tolist())
    with open(out + ".motion", "w") as file:
        file.write("Skeletool Motion File V1.0\n0 " + " ".join("%.9g" % d for d in dofs[0].tolist()) + "\n")
    print(f"{vertices.shape[1]} vertices written to {out}.obj")
    if placed:
        if not valid.item():
            print("the keypoints do not determine where the person is")
        draw_points(image, vertices[0], view, 0, 0.5, (80, 160, 255))
        draw_points(image, landmarks[0], view, 1, 1.0, (255, 60, 40))
        with open(out + ".ppm", "wb") as file:
            file.write(b"P6\n%d %d\n255\n" % (image.shape[1], image.shape[0]) + image.tobytes())


if __name__ == "__main__":
    main()
