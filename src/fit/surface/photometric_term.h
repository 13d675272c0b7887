#pragma once

#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/fit/surface/colour_pyramid.h"
#include "doppel/fit/surface/surface_term.h"

namespace doppel {

/// The image shows every vertex that the camera sees in the vertex's own colour (4.9): I_Gauss(pi(V_i)) - C_i, RGB
/// 0..1. Vertices whose colour is farther off than `threshold` when a step begins have no row during it: what they are
/// compared with is probably something else (sigma_c).
class PhotometricTerm : public SurfaceTerm {
 public:
  /// @param camera without distortion; @param visible [N] not 0 for vertices that it sees; @param colours [3,N] RGB
  /// 0..1; all, and the pyramid, must outlive the term
  PhotometricTerm(const Camera& camera, const ColourPyramid& pyramid, const std::vector<char>& visible,
                  const Eigen::Matrix3Xd& colours, double weight, double threshold);

  /// The level of the pyramid to compare with, 0 the most blurred; before the next `freeze`.
  void set_level(int level) { level_ = level; }
  int num_used() const;  ///< vertices with rows since the last `freeze`

  std::string name() const override { return "photometric"; }
  Element element() const override { return Element::vertex; }
  void freeze(const SurfacePoints& vertices) override;
  PointRows rows(int vertex, const SurfacePoints& vertices) const override;

 private:
  const Camera& camera_;
  const ColourPyramid& pyramid_;
  const std::vector<char>& visible_;
  const Eigen::Matrix3Xd& colours_;
  double weight_, threshold_;
  int level_ = 0;
  std::vector<char> used_;  ///< [N]
};

}  // namespace doppel
