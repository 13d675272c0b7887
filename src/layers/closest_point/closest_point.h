#pragma once

/// The closest point on a deforming closed mesh (6.12.3.2): the surface point nearest to a point in space, and the
/// signed distance between both. Values stored at the vertices, for example motion features, are interpolated at the
/// surface point (b of 6.25).
///
/// Letters: B batch, N vertices, F faces, P points, H values per vertex. Metres.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <memory>

#include "doppel/geometry/closed_surface.h"

namespace doppel {

/// The closest points on a surface.
struct ClosestPoints {
  /// [B,P] signed distance, negative inside. Gradient to vertices and points: exact, also on the surface. If several
  /// points of the surface are equally close, the gradient is that of the point found.
  torch::Tensor distance;
  /// [B,P,3] barycentric coordinates in `face`, >= 0, sum 1. A corner that the closest point does not depend on (on an
  /// edge or in a vertex) has exactly 0. Gradient to vertices and points with the face, edge or vertex held fixed.
  torch::Tensor weights;
  torch::Tensor face;  ///< int64 [B,P], the lowest index among faces at the same distance
};

/// Holds the template's faces and a tree of boxes around them. Each call refits the tree to its vertices.
class ClosestPointImpl : public torch::nn::Module {
 public:
  /// @param mesh the template, which must be closed; it decides which faces share a box
  /// @throws Error naming open edges, see faces_across_edges
  explicit ClosestPointImpl(const TriangleMesh& mesh);

  /// Exact, computed in double. float32 on the CPU searches the tree in parallel over points, with the same bits for
  /// any number of threads; everything else runs the reference. The tree is an object, so no dispatcher op exists.
  /// @param vertices [B,N,3] @param points [B,P,3]
  /// @throws UsageError naming the argument, with the shape found, or when a number is not finite
  ClosestPoints forward(const torch::Tensor& vertices, const torch::Tensor& points) const;
  /// The same in plain tensor operations, for any device and float type. It compares every point with every face.
  ClosestPoints forward_reference(const torch::Tensor& vertices, const torch::Tensor& points) const;

  /// Values of the vertices at the closest points. @param values [B,N,H] @return [B,P,H]; gradients to values and
  /// weights
  torch::Tensor interpolate(const ClosestPoints& at, const torch::Tensor& values) const;

  /// A copy of the template's surface, for moves and searches without tensors.
  ClosedSurface surface() const { return *rest_; }
  const torch::Tensor& faces() const { return faces_; }  ///< int64 [F,3]
  int64_t num_vertices() const { return rest_->num_vertices(); }
  void pretty_print(std::ostream& stream) const override;

 private:
  std::shared_ptr<const ClosedSurface> rest_;
  torch::Tensor faces_, across_;  ///< int64 [F,3]
};
TORCH_MODULE(ClosestPoint);

/// d of 6.25: the distance divided by t_mi inside and by t_ma outside, clamped to [-1, 1].
/// @param distance any shape, metres @param t_mi, t_ma metres, > 0
torch::Tensor normalised_distance(const torch::Tensor& distance, double t_mi, double t_ma);

/// Converts positions [N,3], float32 or float64 on the CPU, to the form that ClosedSurface takes.
std::vector<Eigen::Vector3d> positions_of(const torch::Tensor& vertices);

}  // namespace doppel
