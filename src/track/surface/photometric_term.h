#pragma once

#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/track/surface/colour_pyramid.h"
#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// Matches the colours of visible vertices to the image (4.9): the residual is I_Gauss(pi(V_i)) - C_i, RGB 0..1.
/// Vertices whose colour difference exceeds `threshold` (sigma_c) at the start of a step have no residual during the
/// step: the image probably shows something else there.
class PhotometricTerm : public SurfaceTerm {
 public:
  /// @param visible [N] not 0 for visible vertices @param colours [3,N] RGB 0..1;
  /// these and the pyramid must outlive the term
  /// @param weight per squared colour difference @param threshold largest colour difference
  PhotometricTerm(const PinholeCamera& camera, const ColourPyramid& pyramid, const std::vector<char>& visible,
                  const Eigen::Matrix3Xd& colours, double weight, double threshold);

  /// Sets the level of the pyramid, 0 the most blurred. Takes effect with the next `freeze`.
  void set_level(int level) { level_ = level; }
  int num_used() const;  ///< vertices with residuals since the last `freeze`

  std::string name() const override { return "photometric"; }
  Element element() const override { return Element::vertex; }
  void freeze(const SurfacePoints& vertices) override;
  PointRows rows(int vertex, const SurfacePoints& vertices) const override;

 private:
  const PinholeCamera& camera_;
  const ColourPyramid& pyramid_;
  const std::vector<char>& visible_;
  const Eigen::Matrix3Xd& colours_;
  double weight_, threshold_;
  int level_ = 0;
  std::vector<char> used_;  ///< [N]
};

}  // namespace doppel
