#!/usr/bin/python3
"""Poses an exported Doppel actor from Python. Needs PyTorch and NumPy and nothing of Doppel.

    play_actor.py actor.pt poseAngles.motion vertices.npy
"""
import json
import sys

import numpy as np
import torch


def main():
    actor_path, motion_path, out_path = sys.argv[1:]
    extra = {"metadata.json": "", "faces.npy": ""}
    actor = torch.jit.load(actor_path, _extra_files=extra)
    about = json.loads(extra["metadata.json"])

    dofs = torch.from_numpy(np.loadtxt(motion_path, skiprows=1, ndmin=2)[:, 1:].astype(np.float32))
    frames = torch.arange(len(dofs))[:, None] + torch.arange(about["window"]) - (about["window"] - 1)
    windows = dofs[frames.clamp(min=0)]  # oldest first; the first frame repeats where history is missing

    with torch.no_grad():
        vertices = torch.cat([actor(window[None]) for window in windows])
    np.save(out_path, vertices.numpy())
    print(f"{about['name']}: {len(vertices)} frames of {about['num_vertices']} vertices, {about['units']}")


if __name__ == "__main__":
    main()
