#include "doppel/layers/closest_point/closest_point.h"

#include <ATen/Parallel.h>

#include <Eigen/Geometry>
#include <array>

#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/closest_point/closest_point_checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

using Eigen::Vector3d;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// Points per piece of work of a thread.
constexpr int64_t kGrain = 128;

Tensor triangle_tensor(const std::vector<Triangle>& triangles) {
  const Tensor result = torch::empty({static_cast<int64_t>(triangles.size()), 3}, torch::kInt64);
  int64_t* out = result.data_ptr<int64_t>();
  for (const Triangle& triangle : triangles)
    for (int vertex : triangle) *out++ = vertex;
  return result;
}

Vector3d vector_at(const float* p) { return {p[0], p[1], p[2]}; }

/// The results of a search, and the gradient of the distance with respect to the point.
struct Found {
  Tensor distance, weights, face, outward;
};

Found search(const ClosedSurface& rest, const Tensor& vertices, const Tensor& points_in) {
  const Tensor points = points_in.contiguous();
  const int64_t B = points.size(0), P = points.size(1);
  Found found{points.new_empty({B, P}), points.new_empty({B, P, 3}), points.new_empty({B, P}, torch::kInt64),
              points.new_empty({B, P, 3})};
  ClosedSurface surface = rest;
  for (int64_t b = 0; b < B; ++b) {
    surface.move(positions_of(vertices[b]));
    at::parallel_for(b * P, (b + 1) * P, kGrain, [&](int64_t begin, int64_t end) {
      int near = -1;
      for (int64_t i = begin; i < end; ++i) {
        const ClosedSurface::Hit hit = surface.closest(vector_at(points.data_ptr<float>() + 3 * i), near);
        near = hit.face;  // the next point is often close
        found.distance.data_ptr<float>()[i] = static_cast<float>(hit.distance);
        found.face.data_ptr<int64_t>()[i] = hit.face;
        for (int k = 0; k < 3; ++k) {
          found.weights.data_ptr<float>()[3 * i + k] = static_cast<float>(hit.weights[k]);
          found.outward.data_ptr<float>()[3 * i + k] = static_cast<float>(hit.outward[k]);
        }
      }
    });
  }
  return found;
}

/// lambda_k = the derivative of the loss for a motion of corner k along the offset between point and surface: the
/// gradient to the weights through the conditions of the closest point. 0 for corners that it does not depend on.
std::array<double, 3> through_weights(const std::array<Vector3d, 3>& corners, const float* weights, const float* grad) {
  std::array<double, 3> lambda{};
  const int zeros = (weights[0] == 0) + (weights[1] == 0) + (weights[2] == 0);
  if (zeros == 0) {
    const Vector3d a = corners[1] - corners[0], b = corners[2] - corners[0];
    const double aa = a.dot(a), ab = a.dot(b), bb = b.dot(b), area = a.cross(b).squaredNorm();
    if (!(area > 0)) return lambda;
    const double ga = static_cast<double>(grad[1]) - grad[0], gb = static_cast<double>(grad[2]) - grad[0];
    lambda[1] = (bb * ga - ab * gb) / area;
    lambda[2] = (aa * gb - ab * ga) / area;
    lambda[0] = -lambda[1] - lambda[2];
  } else if (zeros == 1) {
    const int missing = weights[0] == 0 ? 0 : weights[1] == 0 ? 1 : 2;
    const int from = (missing + 1) % 3, to = (missing + 2) % 3;
    const double length = (corners[to] - corners[from]).squaredNorm();
    if (!(length > 0)) return lambda;
    lambda[to] = (static_cast<double>(grad[to]) - grad[from]) / length;
    lambda[from] = -lambda[to];
  }
  return lambda;
}

/// Gradients of one item. @param vertices [N,3] @param found of the item: [P], [P,3], ... @param to_vertices float64
/// [N,3]
void pull_back(const Tensor& vertices, const Tensor& points, const Tensor& faces, const Found& found,
               const Tensor& grad_distance, const Tensor& grad_weights, const Tensor& to_vertices,
               const Tensor& to_points) {
  const float *v = vertices.data_ptr<float>(), *p = points.data_ptr<float>(), *w = found.weights.data_ptr<float>();
  const float *outward = found.outward.data_ptr<float>(), *gw = grad_weights.data_ptr<float>();
  for (int64_t i = 0; i < points.size(0); ++i, p += 3, w += 3, outward += 3, gw += 3) {
    const int64_t* face = faces.data_ptr<int64_t>() + 3 * found.face.data_ptr<int64_t>()[i];
    std::array<Vector3d, 3> corners;
    Vector3d offset = vector_at(p);
    for (int k = 0; k < 3; ++k) {
      corners[k] = vector_at(v + 3 * face[k]);
      offset -= w[k] * corners[k];
    }
    const std::array<double, 3> lambda = through_weights(corners, w, gw);
    // A motion of the point, or the opposite motion of all corners.
    Vector3d along = static_cast<double>(grad_distance.data_ptr<float>()[i]) * vector_at(outward);
    for (int k = 0; k < 3; ++k) along += lambda[k] * corners[k];
    for (int axis = 0; axis < 3; ++axis) to_points.data_ptr<float>()[3 * i + axis] = static_cast<float>(along[axis]);
    for (int k = 0; k < 3; ++k) {
      double* to = to_vertices.data_ptr<double>() + 3 * face[k];
      for (int axis = 0; axis < 3; ++axis) to[axis] += lambda[k] * offset[axis] - w[k] * along[axis];
    }
  }
}

class ClosestPointFunction : public torch::autograd::Function<ClosestPointFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& vertices, const Tensor& points, const Tensor& faces,
                               const std::shared_ptr<const ClosedSurface>& rest) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    const Found found = search(*rest, vertices, points);
    ctx->save_for_backward({vertices, points, faces, found.weights, found.face, found.outward});
    ctx->mark_non_differentiable({found.face});
    return {found.distance, found.weights, found.face};
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    const variable_list saved = ctx->get_saved_variables();
    variable_list gradients(4);
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      const Tensor vertices = saved[0].contiguous(), points = saved[1].contiguous(), &weights = saved[3];
      const Tensor by_distance = grads[0].defined() ? grads[0].contiguous() : torch::zeros_like(points.select(-1, 0));
      const Tensor by_weights = grads[1].defined() ? grads[1].contiguous() : torch::zeros_like(weights);
      Tensor to_vertices = torch::zeros(vertices.sizes(), torch::kFloat64), to_points = torch::empty_like(points);
      at::parallel_for(0, vertices.size(0), 1, [&](int64_t begin, int64_t end) {
        for (int64_t b = begin; b < end; ++b)
          pull_back(vertices[b], points[b], saved[2], {{}, weights[b], saved[4][b], saved[5][b]}, by_distance[b],
                    by_weights[b], to_vertices[b], to_points[b]);
      });
      gradients[0] = to_vertices.to(torch::kFloat32);
      gradients[1] = to_points;
    }
    return once_differentiable(gradients, "doppel::closest_point");
  }
};

}  // namespace

std::vector<Vector3d> positions_of(const Tensor& vertices) {
  check_shape("positions_of", "vertices", vertices, {-1, 3}, "[N,3]");
  const Tensor rows = vertices.detach().to(torch::kFloat64).contiguous();
  std::vector<Vector3d> positions(rows.size(0));
  const double* p = rows.data_ptr<double>();
  for (Vector3d& position : positions) {
    position = {p[0], p[1], p[2]};
    p += 3;
  }
  return positions;
}

ClosestPointImpl::ClosestPointImpl(const TriangleMesh& mesh)
    : torch::nn::Module("ClosestPoint"), rest_(std::make_shared<ClosedSurface>(mesh.vertices, mesh.faces)) {
  faces_ = triangle_tensor(rest_->faces());
  across_ = triangle_tensor(rest_->across());
}

ClosestPoints ClosestPointImpl::forward(const Tensor& vertices, const Tensor& points) const {
  if (!takes_kernel(vertices)) return forward_reference(vertices, points);
  check_closest_point_arguments(vertices, points, num_vertices());
  const variable_list found = ClosestPointFunction::apply(vertices, points, faces_, rest_);
  return {found[0], found[1], found[2]};
}

Tensor ClosestPointImpl::interpolate(const ClosestPoints& at, const Tensor& values) const {
  check_shape("closest_point", "values", values, {at.face.size(0), num_vertices(), -1}, "[B,N,H]");
  const int64_t B = values.size(0), N = values.size(1), P = at.face.size(1), H = values.size(2);
  const Tensor faces = index_like(faces_, values);
  const Tensor item = torch::arange(B, faces.options()).view({B, 1, 1}) * N;
  const Tensor corners = faces.index_select(0, at.face.flatten()).view({B, P, 3}) + item;
  // The gradient of an embedding sums rows much faster than that of an index.
  return (torch::embedding(values.reshape({B * N, H}), corners) * at.weights.unsqueeze(-1)).sum(2);
}

void ClosestPointImpl::pretty_print(std::ostream& stream) const {
  stream << "ClosestPoint(" << num_vertices() << " vertices, " << faces_.size(0) << " faces)";
}

Tensor normalised_distance(const Tensor& distance, double t_mi, double t_ma) {
  if (!(t_mi > 0) || !(t_ma > 0))
    fail<UsageError>("normalised_distance: t_mi is {} m and t_ma {} m; both must be greater than 0", t_mi, t_ma);
  return torch::where(distance < 0, distance / t_mi, distance / t_ma).clamp(-1, 1);
}

}  // namespace doppel
