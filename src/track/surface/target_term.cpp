#include "doppel/track/surface/target_term.h"

namespace doppel {

TargetTerm::TargetTerm(std::string name, const Eigen::Matrix3Xd& targets, double weight)
    : name_(std::move(name)), targets_(targets), weight_(weight) {}

PointRows TargetTerm::rows(int vertex, const SurfacePoints& vertices) const {
  PointRows rows;
  rows.count = 3;
  rows.weight = weight_;
  rows.values = vertices.col(vertex) - targets_.col(vertex);
  rows.jacobian.setIdentity();
  return rows;
}

}  // namespace doppel
