#include "doppel/track/energy/alignment.h"

#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kFirm = 0.05;  // metres per radian: a landmark that moves this much counts half

}  // namespace

std::vector<double> rigidity_of_landmarks(const PoseModel& model) {
  const PosedBody body = model.pose(model.character().rest_dofs, true);
  std::vector<double> weights;
  for (int m = 0; m < model.num_landmarks(); ++m) {
    double moved = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.num_unknowns());
      model.add_landmark_jacobian(body, m, Vector3d::Unit(axis), PoseModel::Row(row.data(), row.size()));
      for (int u = 0; u < model.num_unknowns(); ++u)
        if (const auto dof = model.dof_of(u); dof && !model.moves_root(*dof)) moved += row[u] * row[u];
    }
    weights.push_back(kFirm * kFirm / (kFirm * kFirm + moved));
  }
  return weights;
}

std::optional<std::vector<double>> align_root(const PoseModel& model, const std::vector<double>& dofs,
                                              const std::vector<std::optional<TriangulatedPoint>>& points,
                                              const std::vector<double>& weights) {
  if (!model.root()) return std::nullopt;
  const PosedBody body = model.pose(dofs, false);
  Vector3d from_mean = Vector3d::Zero(), to_mean = Vector3d::Zero();
  double sum = 0.0;
  int count = 0;
  const auto each = [&](const auto& take) {
    for (std::size_t m = 0; m < points.size(); ++m)
      if (points[m]) take(weights[m], model.landmark(body, static_cast<int>(m)), points[m]->position);
  };
  each([&](double weight, const Vector3d& from, const Vector3d& to) {
    from_mean += weight * from;
    to_mean += weight * to;
    sum += weight;
    ++count;
  });
  if (count < 3 || !(sum > 0.0)) return std::nullopt;
  from_mean /= sum;
  to_mean /= sum;
  Matrix3d covariance = Matrix3d::Zero();
  each([&](double weight, const Vector3d& from, const Vector3d& to) {
    covariance += weight / sum * (to - to_mean) * (from - from_mean).transpose();
  });
  const Vector3d spread = svd(covariance).values;
  if (spread[1] < 1e-3 * spread[0] || spread[0] < 1e-6) return std::nullopt;
  const Matrix3d turn = nearest_rotation(covariance);
  const RootRotation& root = *model.root();
  std::vector<double> result = dofs;
  root.set_position(result, turn * (root.position(dofs) - from_mean) + to_mean);
  root.set_matrix(result, turn * root.matrix(dofs));
  return result;
}

}  // namespace doppel
