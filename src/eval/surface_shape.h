#pragma once

#include <torch/types.h>

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "doppel/eval/mean.h"

namespace doppel {

/// The edges, faces and borders of a mesh, to measure the shape of its surfaces. Letters: N vertices, F faces.
///
/// A border is where a garment ends: an open edge, and the line between two labels. This line halves every edge whose
/// ends have different labels; in a face with two labels it is half as long as the edge whose ends have the same label.
/// A face with three labels adds nothing.
class SurfaceShape {
 public:
  /// @param faces int32 [F,3] @param labels of the vertices [N], or empty: only open edges are borders
  /// @throws UsageError for another shape, type or number of labels; Error for an index beyond the vertices
  SurfaceShape(const torch::Tensor& faces, std::int64_t num_vertices, const std::vector<int>& labels);

  /// The normal of a vertex times twice the area of its faces, float64 [N,3]. @param vertices [N,3]
  torch::Tensor area_normals(const torch::Tensor& vertices) const;
  /// The uniform Laplacian: the value of a vertex minus the mean of its neighbours' values, float64 [N,3]; 0 for a
  /// vertex without neighbours. @param values at the vertices [N,3]
  torch::Tensor laplacian(const torch::Tensor& values) const;
  /// The length of all borders, in the unit of the vertices; 0 without borders. @param vertices [N,3]
  double border_length(const torch::Tensor& vertices) const;

 private:
  void find_borders(const std::vector<std::array<int, 3>>& faces, const std::vector<int>& labels);

  std::int64_t num_vertices_;
  torch::Tensor faces_;            ///< int64 [F,3]
  torch::Tensor source_, target_;  ///< int64 [2E], the edges in both directions
  torch::Tensor degree_;           ///< float64 [N,1], neighbours of each vertex
  torch::Tensor border_;           ///< int64 [S,2], edges that are as long as a piece of a border, times their share
  torch::Tensor border_share_;     ///< float64 [S]
};

/// How the shape of surfaces differs from that of the true surfaces, over frames. A spike is a small error of position
/// and a large one of shape.
///
/// The roughness of a displacement d is the root mean square of |L d| over vertices and frames, with the uniform
/// Laplacian L. Displacements are differences of world positions from the skinned template in the same pose. Where the
/// skeleton turns a part of the body as a whole, |L d| is the same in the world and in the bind pose. Near joints it is
/// not, but no inverse of the skinning is needed, which would divide by small numbers there.
class ShapeErrors {
 public:
  explicit ShapeErrors(SurfaceShape shape) : shape_(std::move(shape)) {}

  /// Adds a frame. @param vertices, expected [N,3] world metres
  void add(const torch::Tensor& vertices, const torch::Tensor& expected);
  /// Adds the displacements of a frame. @param found, expected [N,3] metres: each surface minus the skinned template in
  /// its own pose
  void add_displacements(const torch::Tensor& found, const torch::Tensor& expected);

  /// The angle between the vertex normals, area-weighted, of both surfaces: degrees, mean over the vertices that have a
  /// normal on both, mean over frames. Nothing without frames.
  std::optional<double> normal_error() const { return value_of(normal_); }
  /// The root mean square of |L (surface - true surface)|, metres. Nothing without frames.
  std::optional<double> roughness_error() const;
  /// The roughness of the displacements over that of the true ones. Nothing without frames, and where the true
  /// displacements are as smooth as rounding.
  std::optional<double> roughness_ratio() const;
  /// The length of the borders over that of the true ones, mean over frames. Nothing without borders.
  std::optional<double> border_length_ratio() const { return value_of(border_); }

 private:
  static std::optional<double> value_of(const Mean& mean);
  /// The mean over vertices of |L values|^2.
  double square(const torch::Tensor& values) const;

  SurfaceShape shape_;
  Mean normal_, border_;
  Mean difference_, found_, expected_;  ///< square() of the frames
};

}  // namespace doppel
