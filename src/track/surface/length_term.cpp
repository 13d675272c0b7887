#include "doppel/track/surface/length_term.h"

#include "doppel/core/as_size.h"

namespace doppel {

LengthTerm::LengthTerm(const std::vector<Link>& edges, const std::vector<double>& edge_weights,
                       const std::vector<double>& rest_lengths, double weight)
    : edges_(edges), edge_weights_(edge_weights), rest_lengths_(rest_lengths), weight_(weight) {}

PointRows LengthTerm::rows(int edge, const SurfacePoints& vertices) const {
  constexpr double kMinLength = 1e-9;  // metres; a shorter edge has no direction
  const auto e = as_size(edge);
  const auto [a, b] = edges_[e];
  const Eigen::Vector3d difference = vertices.col(a) - vertices.col(b);
  const double length = difference.norm();
  PointRows rows;
  rows.count = 1;
  rows.weight = weight_ * edge_weights_[e];
  rows.values[0] = length - rest_lengths_[e];
  if (length > kMinLength) rows.jacobian.row(0) = difference.transpose() / length;
  return rows;
}

}  // namespace doppel
