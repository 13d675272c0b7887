#pragma once

/// The closest point on a deforming closed mesh (6.12.3.2): where on the surface a point of space belongs, and how far
/// outside or inside it is. What is stored at the vertices, motion features say, is interpolated there (b of 6.25).
///
/// Letters: B batch, N vertices, F faces, P points, H values per vertex. Metres.

#include <torch/torch.h>

#include <memory>

#include "doppel/geometry/closed_surface.h"

namespace doppel {

/// Where points belong on a surface.
struct ClosestPoints {
  /// [B,P] signed distance, negative inside. Gradient to vertices and points: exact, also on the surface. Where several
  /// points of the surface are equally close it is that of the one found.
  torch::Tensor distance;
  /// [B,P,3] barycentric, >= 0, sum 1, of the corners of `face`; exactly 0 where the point lies on an edge or in a
  /// vertex. Gradient to vertices and points with the face, edge or vertex kept.
  torch::Tensor weights;
  torch::Tensor face;  ///< int64 [B,P]; of several at the same distance the lowest
};

/// Holds the template's faces and a tree of boxes over them, which each call refits to the vertices it is given.
class ClosestPointImpl : public torch::nn::Module {
 public:
  /// @param mesh the template: decides which faces share a box, and must be closed, or there is no inside
  /// @throws Error naming open edges, see faces_across_edges
  explicit ClosestPointImpl(const TriangleMesh& mesh);

  /// Exact, with doubles inside. float32 on the CPU searches the tree, parallel over points, the same bits for any
  /// number of threads; everything else takes the reference. The tree is an object, so there is no dispatcher entry.
  /// @param vertices [B,N,3] @param points [B,P,3]
  /// @throws UsageError naming the argument, with the shape found, or when a number is not finite
  ClosestPoints forward(const torch::Tensor& vertices, const torch::Tensor& points) const;
  /// The same in plain tensor operations: every point against every face, any device and float type.
  ClosestPoints forward_reference(const torch::Tensor& vertices, const torch::Tensor& points) const;

  /// Values of the vertices at the closest points. @param values [B,N,H] @return [B,P,H]; gradients to values and
  /// weights
  torch::Tensor interpolate(const ClosestPoints& at, const torch::Tensor& values) const;

  /// A copy of the template's surface, to move and search without tensors.
  ClosedSurface surface() const { return *rest_; }
  const torch::Tensor& faces() const { return faces_; }  ///< int64 [F,3]
  int64_t num_vertices() const { return rest_->num_vertices(); }
  void pretty_print(std::ostream& stream) const override;

 private:
  std::shared_ptr<const ClosedSurface> rest_;
  torch::Tensor faces_, across_;  ///< int64 [F,3]
};
TORCH_MODULE(ClosestPoint);

/// d of 6.25: the distance as a part of t_mi inside and of t_ma outside, within [-1, 1].
/// @param distance any shape, metres @param t_mi, t_ma metres, > 0
torch::Tensor normalised_distance(const torch::Tensor& distance, double t_mi, double t_ma);

/// Positions [N,3] float32 or float64 on the CPU as ClosedSurface takes them.
std::vector<Eigen::Vector3d> positions_of(const torch::Tensor& vertices);

}  // namespace doppel
