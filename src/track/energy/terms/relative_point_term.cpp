#include "doppel/track/energy/terms/relative_point_term.h"

namespace doppel {

RelativePointTerm::RelativePointTerm(std::string name, std::vector<PointTerm::Target> targets, double weight)
    : name_(std::move(name)), targets_(std::move(targets)), weight_(weight) {
  for (const PointTerm::Target& target : targets_) {
    sum_ += target.weight;
    middle_ += target.weight * target.point;
  }
  if (sum_ > 0.0) middle_ /= sum_;
}

void RelativePointTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 3, RobustKernel{}, jacobian);
  if (!(sum_ > 0.0)) return;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  using Jacobian = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  Jacobian mean = Jacobian::Zero(3, jacobian ? model.num_unknowns() : 0);
  for (const PointTerm::Target& target : targets_) {
    const double share = target.weight / sum_;
    middle += share * model.landmark(body, target.landmark);
    for (int axis = 0; jacobian && axis < 3; ++axis)
      model.add_landmark_jacobian(body, target.landmark, share * Eigen::Vector3d::Unit(axis),
                                  PoseModel::Row(mean.row(axis).data(), mean.cols()));
  }
  for (const PointTerm::Target& target : targets_) {
    const Eigen::Index first = rows.add_group(weight_ * target.weight);
    const Eigen::Vector3d difference = (model.landmark(body, target.landmark) - middle) - (target.point - middle_);
    for (int axis = 0; axis < 3; ++axis) {
      rows.value(first + axis) = difference[axis];
      if (!jacobian) continue;
      rows.jacobian(first + axis) = -mean.row(axis);
      model.add_landmark_jacobian(body, target.landmark, Eigen::Vector3d::Unit(axis), rows.jacobian(first + axis));
    }
  }
}

}  // namespace doppel
