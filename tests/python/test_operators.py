"""Tests of the package: gradcheck in float64, kernels (float32) against references (float64), errors.

PYTHONPATH=python /usr/bin/python3 -m unittest discover -s tests/python
"""
import math
import unittest

import torch

import doppel

EYE = torch.eye(3, 4)


def octahedron(times: int = 3) -> tuple[torch.Tensor, torch.Tensor]:
    """A unit sphere of 8 * 4^times faces."""
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(times):
        middle, finer = {}, []

        def between(a: int, b: int) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                p = [(x + y) / 2 for x, y in zip(points[a], points[b])]
                length = math.sqrt(sum(x * x for x in p))
                points.append(tuple(x / length for x in p))
                middle[key] = len(points) - 1
            return middle[key]

        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return torch.tensor(points, dtype=torch.float32), torch.tensor(faces)


def camera(size: int = 96) -> torch.Tensor:
    """A camera three metres in front of the origin, [1,1,3,4]."""
    k = torch.tensor([[size, 0.0, size / 2], [0.0, size, size / 2], [0.0, 0.0, 1.0]])
    view = torch.tensor([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 3.0]])
    return (k @ view)[None, None]


def rigid(count: int, generator: torch.Generator) -> torch.Tensor:
    """Rotations of any angle and small translations, float64 [2,count,3,4]."""
    q = torch.nn.functional.normalize(torch.randn(2, count, 4, generator=generator, dtype=torch.float64), dim=-1)
    w, x, y, z = q.unbind(-1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
            1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
            1 - 2 * (x * x + y * y)]
    rotation = torch.stack(rows, -1).view(2, count, 3, 3)
    return torch.cat([rotation, 0.1 * torch.randn(2, count, 3, 1, generator=generator, dtype=torch.float64)], -1)


class Operators(unittest.TestCase):
    def setUp(self) -> None:
        self.draw = torch.Generator().manual_seed(3)

    def random(self, *shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=self.draw, dtype=torch.float64)

    def check(self, function, *inputs: torch.Tensor, tolerance: float = 1e-5) -> None:
        """gradcheck in float64; values and gradients of float32 against float64."""
        exact = [x.clone().requires_grad_() for x in inputs]
        self.assertTrue(torch.autograd.gradcheck(function, exact, atol=1e-6, rtol=1e-4))
        single = [x.float().requires_grad_() for x in inputs]
        expected, found = function(*exact), function(*single)
        self.assertEqual(found.dtype, torch.float32)
        self.assertLess((found - expected).abs().max().item(), tolerance)
        weights = self.random(*expected.shape)
        wanted = torch.autograd.grad((expected * weights).sum(), exact)
        got = torch.autograd.grad((found * weights.float()).sum(), single)
        for a, b in zip(got, wanted):
            self.assertLess((a - b).abs().max().item(), tolerance * max(1.0, b.abs().max().item()) * 10)

    def weights(self, rows: int, columns: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        items = torch.stack([torch.randperm(columns, generator=self.draw)[:2] for _ in range(rows)]).flatten()
        share = 0.2 + 0.3 * torch.rand(rows, generator=self.draw, dtype=torch.float64)
        return 2 * torch.arange(rows + 1), items, torch.stack([1 - share, share], 1).flatten()

    def test_linear_skinning(self) -> None:
        layer = doppel.Skinning(*self.weights(5, 3), 3, dual_quaternions=False)
        self.check(layer, self.random(2, 5, 3), rigid(3, self.draw))

    def test_skinning_by_dual_quaternions(self) -> None:
        layer, bones = doppel.Skinning(*self.weights(5, 3), 3), rigid(3, self.draw)
        self.check(lambda points: layer(points, bones.to(points.dtype)), self.random(2, 5, 3))

    def test_embedded_deformation(self) -> None:
        layer = doppel.EmbeddedDeformation(self.random(6, 3), self.random(3, 3), *self.weights(6, 3))
        self.check(layer, 0.3 * self.random(2, 3, 3), 0.1 * self.random(2, 3, 3), 0.1 * self.random(2, 6, 3))

    def test_graph_convolution(self) -> None:
        layer = doppel.GraphConvolution(torch.tensor([[0, 1], [1, 2], [2, 3], [3, 0]]), 4)
        self.check(layer, self.random(2, 4, 3), self.random(4, 3, 2), self.random(4, 2))

    def test_closest_point(self) -> None:
        vertices, faces = octahedron(1)
        layer = doppel.ClosestPoint(vertices, faces)
        points = 0.4 * self.random(1, 7, 3)
        self.check(lambda v, p: layer(v, p).distance, vertices[None].double(), points)
        inside = layer(vertices[None], torch.zeros(1, 1, 3))
        self.assertLess(inside.distance.item(), 0)

    def test_shading(self) -> None:
        vertices, faces = octahedron(0)
        uvs = torch.rand(len(faces), 3, 2, generator=self.draw)
        layer, projection = doppel.Shading(faces, uvs, len(vertices)), camera(12)
        light = self.random(1, 1, 3, 9)

        def image(texture: torch.Tensor, lighting: torch.Tensor) -> torch.Tensor:
            kind = texture.dtype
            return layer(vertices[None].to(kind), texture, lighting, projection.to(kind), 12, 12)[0]

        self.check(image, torch.rand(1, 4, 4, 3, generator=self.draw, dtype=torch.float64), light)

    def test_silhouette_gradient(self) -> None:
        vertices, faces = octahedron(2)
        projection = camera()
        mask = doppel.Shading(faces, None, len(vertices))(1.1 * vertices[None], None, None, projection, 96, 96)[1]
        target = doppel.silhouette_target(mask)
        boundary = doppel.boundary_vertices(vertices[None], projection, faces, 96, 96)
        self.assertGreater(boundary.sum().item(), 10)
        # Along a line that meets no vertex of the outline inside the mask, the loss is smooth: the distance falls.
        single = vertices[None].clone().requires_grad_()
        doppel.silhouette_loss(single, faces, projection, target).backward()
        exact = vertices[None].double().requires_grad_()
        doppel.silhouette_loss(exact, faces, projection, target).backward()
        self.assertLess((single.grad - exact.grad).abs().max().item(), 1e-4 * exact.grad.abs().max().item())
        radial = (exact.grad[0] * vertices).sum(-1)[boundary[0, 0]]
        self.assertLess(radial.sum().item(), 0)  # growing the sphere lowers the loss

    def test_a_sphere_is_fitted_to_a_silhouette(self) -> None:
        vertices, faces = octahedron(2)
        projection = camera()
        mask = doppel.Shading(faces, None, len(vertices))(0.8 * vertices[None], None, None, projection, 96, 96)[1]
        target = doppel.silhouette_target(mask)
        radius = torch.ones((), requires_grad=True)
        optimiser = torch.optim.Adam([radius], lr=0.02)
        for _ in range(80):
            optimiser.zero_grad()
            doppel.silhouette_loss(radius * vertices[None], faces, projection, target).backward()
            optimiser.step()
        self.assertAlmostEqual(radius.item(), 0.8, delta=0.03)

    def test_rasterizer_finds_the_nearest_face(self) -> None:
        vertices, faces = octahedron(3)
        raster = doppel.rasterize((vertices * torch.tensor([1.0, -1.0, -1.0]) + torch.tensor([0.0, 0.0, 3.0]))[None],
                                  torch.tensor([[96.0, 96.0, 48.0, 48.0]]), faces, 96, 96)
        self.assertAlmostEqual(raster.depth[0, 48, 48].item(), 2.0, delta=1e-2)
        area = (raster.face >= 0).sum().item()
        radius = 96 / math.sqrt(3 * 3 - 1)  # of the cone that touches the sphere
        self.assertAlmostEqual(area / (math.pi * radius * radius), 1.0, delta=0.02)

    def test_errors_name_the_argument(self) -> None:
        layer = doppel.Skinning(*self.weights(5, 3), 3)
        with self.assertRaisesRegex(RuntimeError, "bones"):
            layer(torch.zeros(5, 3), torch.zeros(2, 4, 3, 4))
        with self.assertRaisesRegex(RuntimeError, "allowed are 0..1"):
            doppel.GraphConvolution(torch.tensor([[0, 5]]), 2)
        with self.assertRaisesRegex(RuntimeError, "offsets"):
            doppel.Skinning(torch.tensor([0, 9]), torch.tensor([0]), torch.tensor([1.0]), 1)


if __name__ == "__main__":
    unittest.main()
