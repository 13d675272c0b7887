#include "doppel/track/surface/smoothness_term.h"

#include "doppel/core/as_size.h"

namespace doppel {

SmoothnessTerm::SmoothnessTerm(const Eigen::Matrix3Xd& posed, const std::vector<Link>& edges,
                               const std::vector<double>& edge_weights, double weight)
    : posed_(posed), edges_(edges), edge_weights_(edge_weights), weight_(weight) {}

PointRows SmoothnessTerm::rows(int edge, const SurfacePoints& vertices) const {
  const auto e = as_size(edge);
  const auto [a, b] = edges_[e];
  PointRows rows;
  rows.count = 3;
  rows.weight = weight_ * edge_weights_[e];
  rows.values = (vertices.col(a) - vertices.col(b)) - (posed_.col(a) - posed_.col(b));
  rows.jacobian.setIdentity();
  return rows;
}

}  // namespace doppel
