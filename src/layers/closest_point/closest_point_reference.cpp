#include <algorithm>
#include <array>

#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/layers/closest_point/closest_point_checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

using torch::Tensor;

/// Pairs of a point and a face that are compared at a time.
constexpr int64_t kPairs = 1 << 19;

Tensor scalar_product(const Tensor& a, const Tensor& b) { return (a * b).sum(-1); }
Tensor or_one(const Tensor& where, const Tensor& value) { return torch::where(where, value, torch::ones_like(value)); }
Tensor corner(const Tensor& triangles, int k) { return triangles.select(-2, k % 3); }
/// Stacks three tensors [...] to [...,3].
Tensor rows(const std::array<Tensor, 3>& parts) { return torch::stack({parts[0], parts[1], parts[2]}, -1); }

Tensor face_normals(const Tensor& triangles) {
  return torch::cross(corner(triangles, 1) - corner(triangles, 0), corner(triangles, 2) - corner(triangles, 0), -1);
}
/// Unit vectors; 0 for vectors without length.
Tensor directions(const Tensor& v) {
  const Tensor length = v.norm(2, {-1}, true);
  return v / or_one(length > 0, length);
}

/// Positions of points [...,3] relative to triangles [...,3,3], which broadcast.
struct Nearest {
  Tensor squared;  ///< [...]
  Tensor active;   ///< bool [...,3]: corners that the closest point depends on
};
Nearest nearest(const Tensor& points, const Tensor& triangles) {
  const Tensor normal = face_normals(triangles), area = scalar_product(normal, normal);
  std::array<Tensor, 3> beyond, to_edge, at_from, at_to;  // of the edge opposite corner k
  Tensor inside = area > 0;
  for (int k = 0; k < 3; ++k) {
    const Tensor from = corner(triangles, k + 1), along = corner(triangles, k + 2) - from;
    const Tensor start = points - from, length = scalar_product(along, along);
    inside = inside & (scalar_product(torch::cross(normal, along, -1), start) >= 0);
    const Tensor t = (scalar_product(start, along) / or_one(length > 0, length)).clamp(0, 1);
    const Tensor off = start - t.unsqueeze(-1) * along;
    to_edge[k] = scalar_product(off, off);
    at_from[k] = t <= 0;
    at_to[k] = t >= 1;
  }
  const Tensor height = scalar_product(points - corner(triangles, 0), normal);
  const auto [edge_squared, edge] = rows(to_edge).min(-1, true);
  Nearest result;
  result.squared = torch::where(inside, height * height / or_one(area > 0, area), edge_squared.squeeze(-1));
  // Corner j of edge k = j+1 is its end, of edge k = j+2 its start; not of edge k = j.
  std::array<Tensor, 3> active;
  for (int j = 0; j < 3; ++j) {
    const Tensor as_end = (edge.squeeze(-1) == (j + 1) % 3) & at_from[(j + 1) % 3].logical_not();
    const Tensor as_start = (edge.squeeze(-1) == (j + 2) % 3) & at_to[(j + 2) % 3].logical_not();
    active[j] = inside | as_end | as_start;
  }
  result.active = rows(active);
  return result;
}

/// The face closest to each point, the lowest among equals. @param points [P,3] @param triangles [F,3,3]
/// @return int64 [P]
Tensor closest_faces(const Tensor& points, const Tensor& triangles) {
  std::vector<Tensor> faces;
  const int64_t step = std::max<int64_t>(1, kPairs / triangles.size(0));
  for (int64_t p = 0; p < points.size(0); p += step)
    faces.push_back(nearest(points.slice(0, p, p + step).unsqueeze(1), triangles).squared.argmin(1));
  return faces.empty() ? torch::empty({0}, points.options().dtype(torch::kInt64)) : torch::cat(faces);
}

/// Barycentric weights for given active corners, differentiable. @return [B,P,3]
Tensor weights_of(const Tensor& points, const Tensor& triangles, const Tensor& active) {
  const Tensor count = active.sum(-1);
  // A face: two equations for the weights of corners 1 and 2.
  const Tensor a = corner(triangles, 1) - corner(triangles, 0), b = corner(triangles, 2) - corner(triangles, 0);
  const Tensor q = points - corner(triangles, 0);
  const Tensor aa = scalar_product(a, a), ab = scalar_product(a, b), bb = scalar_product(b, b),
               qa = scalar_product(q, a), qb = scalar_product(q, b);
  const Tensor det = or_one(count == 3, aa * bb - ab * ab);
  const Tensor w1 = (bb * qa - ab * qb) / det, w2 = (aa * qb - ab * qa) / det;
  const Tensor on_face = rows({1 - w1 - w2, w1, w2});
  // An edge: from the corner after the inactive corner to the next.
  std::array<Tensor, 3> on_edge{torch::zeros_like(w1), torch::zeros_like(w1), torch::zeros_like(w1)};
  for (int k = 0; k < 3; ++k) {
    const Tensor here = (count == 2) & active.select(-1, k).logical_not();
    const Tensor from = corner(triangles, k + 1), along = corner(triangles, k + 2) - from;
    const Tensor t = scalar_product(points - from, along) / or_one(here, scalar_product(along, along));
    on_edge[(k + 1) % 3] = torch::where(here, 1 - t, on_edge[(k + 1) % 3]);
    on_edge[(k + 2) % 3] = torch::where(here, t, on_edge[(k + 2) % 3]);
  }
  return torch::where((count == 3).unsqueeze(-1), on_face,
                      torch::where((count == 2).unsqueeze(-1), rows(on_edge), active.to(points.scalar_type())));
}

/// Normals of faces, edges and vertices, without gradient; see ClosedSurface.
class PseudoNormals {
 public:
  /// @param vertices [B,N,3] @param faces, across [F,3]
  PseudoNormals(const Tensor& vertices, const Tensor& triangles, const Tensor& faces, const Tensor& across) {
    const Tensor normal = face_normals(triangles);
    face_ = directions(normal);
    edge_ = face_.unsqueeze(2) + face_.index_select(1, across.flatten()).view_as(triangles);
    vertex_ = torch::zeros_like(vertices);
    for (int k = 0; k < 3; ++k) {
      const Tensor to_next = corner(triangles, k + 1) - corner(triangles, k);
      const Tensor to_last = corner(triangles, k + 2) - corner(triangles, k);
      const Tensor angle = torch::atan2(normal.norm(2, {-1}), scalar_product(to_next, to_last));
      vertex_ = vertex_.index_add(1, faces.select(1, k), angle.unsqueeze(-1) * face_);
    }
    corner_ = vertex_.index_select(1, faces.flatten()).view_as(triangles);
  }

  /// @param face int64 [B,P] @param active bool [B,P,3] @return [B,P,3]
  Tensor at(const Tensor& face, const Tensor& active) const {
    const auto of = [&](const Tensor& table) {  // [B,F,...] at the faces
      const Tensor flat = table.flatten(2);
      return flat.gather(1, face.unsqueeze(-1).expand({-1, -1, flat.size(2)}))
          .view({face.size(0), face.size(1), -1, 3});
    };
    const Tensor edges = of(edge_), corners = of(corner_), count = active.sum(-1, true);
    Tensor normal = of(face_).squeeze(2);
    for (int k = 0; k < 3; ++k) {
      const Tensor active_k = active.select(-1, k).unsqueeze(-1);
      normal = torch::where((count == 1) & active_k, corners.select(2, k), normal);
      normal = torch::where((count == 2) & active_k.logical_not(), edges.select(2, (k + 1) % 3), normal);
    }
    return normal;
  }

 private:
  Tensor face_, edge_, vertex_, corner_;  ///< [B,F,3], [B,F,3,3], [B,N,3], [B,F,3,3]
};

}  // namespace

ClosestPoints ClosestPointImpl::forward_reference(const Tensor& vertices, const Tensor& points) const {
  check_closest_point_arguments(vertices, points, num_vertices());
  const int64_t B = vertices.size(0), P = points.size(1);
  const Tensor faces = index_like(faces_, vertices), across = index_like(across_, vertices);
  const Tensor triangles = vertices.index_select(1, faces.flatten()).view({B, -1, 3, 3});
  Tensor face, active, normal;
  {
    const torch::NoGradGuard no_grad;
    std::vector<Tensor> found;
    for (int64_t b = 0; b < B; ++b) found.push_back(closest_faces(points[b], triangles[b]));
    face = B > 0 ? torch::stack(found) : torch::empty({0, P}, faces.options());
  }
  const Tensor chosen = triangles.flatten(2).gather(1, face.unsqueeze(-1).expand({-1, -1, 9})).view({B, P, 3, 3});
  {
    const torch::NoGradGuard no_grad;
    active = nearest(points, chosen).active;
    normal = PseudoNormals(vertices, triangles, faces, across).at(face, active);
  }
  ClosestPoints result;
  result.face = face;
  result.weights = weights_of(points, chosen, active);
  const Tensor offset = points - (result.weights.unsqueeze(-1) * chosen).sum(-2);
  const Tensor length = offset.norm(2, {-1}, true).detach();
  const Tensor side = torch::where(scalar_product(offset, normal).unsqueeze(-1) < 0, -torch::ones_like(length),
                                   torch::ones_like(length));
  const Tensor on_surface = (active.sum(-1, true) == 3) | (length == 0);
  const Tensor outward =
      torch::where(on_surface, directions(normal), side * offset / or_one(length > 0, length)).detach();
  result.distance = scalar_product(offset, outward);
  return result;
}

}  // namespace doppel
