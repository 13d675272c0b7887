#pragma once

#include <vector>

#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// Keeps edges as skinning poses them, in direction and length (4.12): the residual is (V_i - V_j) - (V_i^S - V_j^S),
/// metres.
class SmoothnessTerm : public SurfaceTerm {
 public:
  /// @param posed V^S, [3,N] @param edges, edge_weights of the mesh; all must outlive the term
  /// @param weight per squared metre
  SmoothnessTerm(const Eigen::Matrix3Xd& posed, const std::vector<Link>& edges, const std::vector<double>& edge_weights,
                 double weight);

  std::string name() const override { return "smoothness"; }
  Element element() const override { return Element::edge; }
  PointRows rows(int edge, const SurfacePoints& vertices) const override;

 private:
  const Eigen::Matrix3Xd& posed_;
  const std::vector<Link>& edges_;
  const std::vector<double>& edge_weights_;
  double weight_;
};

}  // namespace doppel
