"""Doppel's operators for PyTorch on the CPU.

Letters in shapes: B batch, C cameras, N vertices, F faces, K graph nodes, H and W pixels. Metres and radians. The world
is right-handed with y up. Cameras are as in OpenCV, and the centre of the first pixel is (0.5, 0.5). A projection
[B,C,3,4] maps world metres to pixels.

float32 runs fused kernels, float64 plain tensor operations with the same result. Autograd works through all functions
that name a gradient. `torch.ops.doppel` and `torch.classes.doppel` hold the operators themselves.

The shared library is looked for in this order: the variable DOPPEL_LIBRARY, this folder, build/release of the source
tree, the paths of the dynamic linker.
"""
from __future__ import annotations

import ctypes.util
import os
from pathlib import Path
from typing import NamedTuple, Optional

import torch
from torch import Tensor

__all__ = [
    "ClosestPoint", "ClosestPoints", "EmbeddedDeformation", "GraphConvolution", "Raster", "Shading", "SilhouetteTarget",
    "Skinning", "boundary_vertices", "rasterize", "silhouette_loss", "silhouette_target"
]


def _library() -> str:
    """The path of libdoppel.so."""
    here, name = Path(__file__).resolve().parent, "libdoppel.so"
    tried = [Path(os.environ["DOPPEL_LIBRARY"])] if "DOPPEL_LIBRARY" in os.environ else []
    tried += [here / name, here.parent.parent / "build/release/shared_library" / name]
    for path in tried:
        if path.is_file():
            return str(path)
    found = ctypes.util.find_library("doppel")
    if found:
        return found
    raise ImportError(
        f"{name} was not found: looked at {', '.join(map(str, tried))} and the paths of the dynamic linker; "
        "build Doppel (target doppel_shared) or set DOPPEL_LIBRARY to the file")


torch.ops.load_library(_library())


class Raster(NamedTuple):
    """What a camera sees, for V views."""

    face: Tensor  #: int32 [V,H,W], the nearest face; -1: background
    depth: Tensor  #: float32 [V,H,W], metres along the camera's axis; infinity: background
    barycentrics: Tensor  #: float32 [V,H,W,3], perspective-correct


def rasterize(vertices_in_camera: Tensor, intrinsics: Tensor, faces: Tensor, height: int, width: int,
              z_near: float = 0.01, cull: bool = False) -> Raster:
    """Draws a mesh into V views. No gradient.

    vertices_in_camera: float32 [V,N,3]; intrinsics: float32 [V,4] or [1,4], fx fy cx cy; faces: int32 or int64 [F,3].

    >>> raster = doppel.rasterize(vertices[None], torch.tensor([[500., 500., 128., 128.]]), faces, 256, 256)
    >>> silhouette = raster.face >= 0
    """
    return Raster(*torch.ops.doppel.rasterize(vertices_in_camera, intrinsics, faces, height, width, z_near, cull))


def boundary_vertices(vertices: Tensor, projection: Tensor, faces: Tensor, height: int, width: int,
                      visible_only: bool = False) -> Tensor:
    """Vertices near the outline of the drawn mesh, bool [B,C,N]. No gradient.

    vertices: [B,N,3] world; projection: [B,C,3,4].
    """
    return torch.ops.doppel.boundary_vertices(vertices, projection, faces, height, width, visible_only)


class SilhouetteTarget(NamedTuple):
    """Masks in the form of `silhouette_loss`."""

    distance: Tensor  #: float32 [B,C,S,S], signed distance to the outline in pixels, + outside
    valid: Tensor  #: bool [B,C], the mask holds person and background
    contour: Tensor  #: float32 [P,2], centres of the contour pixels
    contour_offsets: Tensor  #: int64 [B*C+1], the rows of `contour` of each view


def silhouette_target(masks: Tensor) -> SilhouetteTarget:
    """Distance fields and contours of masks [B,C,S,S], bool or uint8; not 0: the person."""
    return SilhouetteTarget(*torch.ops.doppel.silhouette_target(masks))


def silhouette_loss(vertices: Tensor, faces: Tensor, projection: Tensor, target: SilhouetteTarget,
                    boundary: Optional[Tensor] = None) -> Tensor:
    """Two-sided silhouette loss (6.8): boundary vertices against the outline, contour pixels against the vertices.

    vertices: float32 or float64 [B,N,3] world; gradient to `vertices`. boundary: bool [B,C,N]; None: drawn anew.

    >>> target = doppel.silhouette_target(masks)
    >>> doppel.silhouette_loss(vertices, faces, projection, target).backward()
    """
    if boundary is None:
        boundary = boundary_vertices(vertices, projection, faces, *target.distance.shape[-2:])
    kind = vertices.dtype
    terms = torch.ops.doppel.silhouette(vertices, faces, boundary, projection.to(kind), target.distance.to(kind),
                                        target.valid, target.contour.to(kind), target.contour_offsets)
    return terms[0] + terms[1]


class Shading:
    """A textured mesh under spherical-harmonics lighting (6.10 to 6.12).

    faces: int [F,3]; corner_uvs: float32 [F,3,2], u right, v up, or None.

    >>> image, mask = doppel.Shading(faces, corner_uvs, N)(vertices, texture, None, projection, 256, 256)
    """

    def __init__(self, faces: Tensor, corner_uvs: Optional[Tensor], num_vertices: int) -> None:
        self._layer = torch.classes.doppel.Shading(faces, corner_uvs, num_vertices)

    def __call__(self, vertices: Tensor, texture: Optional[Tensor], lighting: Optional[Tensor], projection: Tensor,
                 height: int, width: int) -> tuple[Tensor, Tensor]:
        """Images [B,C,H,W,3] and masks bool [B,C,H,W]; gradients to vertices, texture and lighting.

        vertices: [B,N,3] world; texture: [1 or B or B*C,Th,Tw,3], row 0 at v = 1, or None (white); lighting: [1 or
        B,C,3,9], or None (albedo).
        """
        return self._layer.forward(vertices, texture, lighting, projection, height, width)


class Skinning:
    """Skinning with fixed weights in compressed rows.

    offsets: int [N+1]; bones: int [E], bone of each entry; weights: [E], those of a vertex sum to 1.

    >>> posed = doppel.Skinning(offsets, bones, weights, num_bones)(points, transforms)
    """

    def __init__(self, offsets: Tensor, bones: Tensor, weights: Tensor, num_bones: int,
                 dual_quaternions: bool = True) -> None:
        self._layer = torch.classes.doppel.Skinning(offsets, bones, weights, num_bones)
        self._dual_quaternions = dual_quaternions

    def __call__(self, points: Tensor, bones: Tensor) -> Tensor:
        """points [N,3] or [B,N,3], rigid transforms [B,Bn,3,4] -> [B,N,3]; gradients to both."""
        return self._layer.forward(points, bones, self._dual_quaternions)


class EmbeddedDeformation:
    """Embedded deformation of a template (6.2, 6.3).

    rest: [N,3] vertices; nodes: [K,3] positions; offsets: int [N+1], items: int [E] and weights: [E]: the nodes of each
    vertex.

    >>> deformed = doppel.EmbeddedDeformation(rest, nodes, offsets, items, weights)(angles, translations)
    """

    def __init__(self, rest: Tensor, nodes: Tensor, offsets: Tensor, items: Tensor, weights: Tensor) -> None:
        self._layer = torch.classes.doppel.EmbeddedDeformation(rest, nodes, offsets, items, weights)

    def __call__(self, angles: Tensor, translations: Tensor, displacements: Optional[Tensor] = None,
                 node_transforms: Optional[Tensor] = None) -> Tensor:
        """angles, translations [B,K,3], displacements [B,N,3], node_transforms [B,K,3,4] -> [B,N,3]; gradients to all."""
        return self._layer.forward(angles, translations, displacements, node_transforms)


class GraphConvolution:
    """Structure-aware graph convolution with a kernel for each node (6.5, 6.6).

    edges: int [E,2]; rings: R of 6.6.

    >>> out = doppel.GraphConvolution(edges, num_nodes)(features, kernels, bias)
    """

    def __init__(self, edges: Tensor, num_nodes: int, rings: int = 3) -> None:
        self._layer = torch.classes.doppel.GraphConvolution(edges, num_nodes, rings)

    def __call__(self, features: Tensor, kernels: Tensor, bias: Tensor) -> Tensor:
        """features [B,K,Hin], kernels [K,Hin,Hout], bias [K,Hout] -> [B,K,Hout]; gradients to all."""
        return self._layer.forward(features, kernels, bias)


class ClosestPoints(NamedTuple):
    distance: Tensor  #: [B,P], negative inside
    weights: Tensor  #: [B,P,3], barycentric coordinates in `face`
    face: Tensor  #: int64 [B,P]


class ClosestPoint:
    """The closest points on a deforming closed mesh. vertices: [N,3] of the template; faces: int [F,3].

    >>> distance, weights, face = doppel.ClosestPoint(rest, faces)(vertices, points)
    """

    def __init__(self, vertices: Tensor, faces: Tensor) -> None:
        self._layer = torch.classes.doppel.ClosestPoint(vertices, faces)

    def __call__(self, vertices: Tensor, points: Tensor) -> ClosestPoints:
        """vertices [B,N,3], points [B,P,3]; gradients of distance and weights to both."""
        return ClosestPoints(*self._layer.forward(vertices, points))
