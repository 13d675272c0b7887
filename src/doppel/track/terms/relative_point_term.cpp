#include "doppel/track/terms/relative_point_term.h"

namespace doppel {

RelativePointTerm::RelativePointTerm(std::string name, std::vector<PointTerm::Target> targets, double weight)
    : name_(std::move(name)), targets_(std::move(targets)), weight_(weight) {
  for (const PointTerm::Target& target : targets_) {
    sum_ += target.weight;
    middle_ += target.weight * target.point;
  }
  if (sum_ > 0.0) middle_ /= sum_;
}

void RelativePointTerm::evaluate(const PoseModel& model, const PosedBody& body, bool slopes, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 3, RobustKernel{}, slopes);
  if (!(sum_ > 0.0)) return;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  using Slopes = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  Slopes mean = Slopes::Zero(3, slopes ? model.num_unknowns() : 0);
  for (const PointTerm::Target& target : targets_) {
    const double share = target.weight / sum_;
    middle += share * model.landmark(body, target.landmark);
    for (int axis = 0; slopes && axis < 3; ++axis)
      model.add_landmark_slope(body, target.landmark, share * Eigen::Vector3d::Unit(axis),
                               PoseModel::Row(mean.row(axis).data(), mean.cols()));
  }
  for (const PointTerm::Target& target : targets_) {
    const Eigen::Index first = rows.add_group(weight_ * target.weight);
    const Eigen::Vector3d difference = (model.landmark(body, target.landmark) - middle) - (target.point - middle_);
    for (int axis = 0; axis < 3; ++axis) {
      rows.value(first + axis) = difference[axis];
      if (!slopes) continue;
      rows.slope(first + axis) = -mean.row(axis);
      model.add_landmark_slope(body, target.landmark, Eigen::Vector3d::Unit(axis), rows.slope(first + axis));
    }
  }
}

}  // namespace doppel
