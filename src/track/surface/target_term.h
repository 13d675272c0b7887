#pragma once

#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// Pulls vertices to given positions: the residual is V_i - q_i, metres. With the vertices of the last frame this is
/// the velocity term (4.14). With the prediction 2 V^{t-1} - V^{t-2} it is the acceleration term (4.15).
class TargetTerm : public SurfaceTerm {
 public:
  /// @param targets [3,N], must outlive the term @param weight per squared metre
  TargetTerm(std::string name, const Eigen::Matrix3Xd& targets, double weight);

  std::string name() const override { return name_; }
  Element element() const override { return Element::vertex; }
  PointRows rows(int vertex, const SurfacePoints& vertices) const override;

 private:
  std::string name_;
  const Eigen::Matrix3Xd& targets_;
  double weight_;
};

}  // namespace doppel
