#include "doppel/track/energy/terms/point_term.h"

namespace doppel {

PointTerm::PointTerm(std::string name, std::vector<Target> targets, double weight, const RobustKernel& kernel)
    : name_(std::move(name)), targets_(std::move(targets)), weight_(weight), kernel_(kernel) {}

void PointTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 3, kernel_, jacobian);
  for (const Target& target : targets_) {
    const Eigen::Index first = rows.add_group(weight_ * target.weight);
    const Eigen::Vector3d error = model.landmark(body, target.landmark) - target.point;
    for (int i = 0; i < 3; ++i) {
      rows.value(first + i) = error[i];
      if (jacobian)
        model.add_landmark_jacobian(body, target.landmark, Eigen::Vector3d::Unit(i), rows.jacobian(first + i));
    }
  }
}

}  // namespace doppel
