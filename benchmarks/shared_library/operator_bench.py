"""The Python side of operator_bench.   operator_bench.py INPUTS THREADS

Reads names of operators, one a line; prints milliseconds per call.
"""
import sys
import time

import torch

import doppel

torch.set_num_threads(int(sys.argv[2]))
i = torch.load(sys.argv[1])
num_vertices = i["vertices"].shape[1]
skinning = doppel.Skinning(i["skin_offsets"], i["skin_items"], i["skin_weights"], 70)
deformation = doppel.EmbeddedDeformation(i["points"], i["nodes"], i["node_offsets"], i["node_items"], i["node_weights"])
convolution = doppel.GraphConvolution(i["edges"], len(i["points"]))
closest = doppel.ClosestPoint(i["vertices"][0], i["faces"])
shading = doppel.Shading(i["faces"], None, num_vertices)
target = doppel.SilhouetteTarget(i["distance"], i["valid"], i["contour"], i["contour_offsets"])
calls = {
    "Skinning": lambda: skinning(i["points"], i["bones"]),
    "EmbeddedDeformation": lambda: deformation(i["angles"], i["moves"]),
    "GraphConvolution": lambda: convolution(i["features"], i["kernels"], i["bias"]),
    "ClosestPoint": lambda: closest(i["vertices"], i["samples"]),
    "Shading": lambda: shading(i["vertices"], None, i["light"], i["cameras"], 512, 512),
    "rasterize": lambda: doppel.rasterize(i["in_camera"], i["intrinsics"], i["faces"], 512, 512),
    "boundary_vertices": lambda: doppel.boundary_vertices(i["vertices"], i["cameras"], i["faces"], 512, 512),
    "silhouette_loss": lambda: doppel.silhouette_loss(i["vertices"], i["faces"], i["cameras"], target, i["outline"]),
}

with torch.no_grad():
    for line in sys.stdin:
        call, count, start = calls[line.strip()], 0, time.perf_counter()
        while time.perf_counter() - start < 0.02:
            call()
            count += 1
        print(1e3 * (time.perf_counter() - start) / count, flush=True)
