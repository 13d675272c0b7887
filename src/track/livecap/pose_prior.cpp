#include "doppel/track/livecap/pose_prior.h"

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kFree = 1e9;  // variance of the root's unknowns

std::vector<double> mean_pose(const PoseModel& model, const std::vector<std::vector<double>>& poses) {
  std::vector<double> mean(model.character().rest_dofs.size(), 0.0);
  for (const std::vector<double>& pose : poses) {
    if (pose.size() != mean.size()) fail("a pose of the prior has {} DoFs, the skeleton {}", pose.size(), mean.size());
    for (std::size_t d = 0; d < mean.size(); ++d) mean[d] += pose[d] / static_cast<double>(poses.size());
  }
  for (std::size_t d = 0; d < mean.size(); ++d)
    if (model.moves_root(static_cast<int>(d))) mean[d] = model.character().rest_dofs[d];
  return mean;
}

}  // namespace

PosePrior learn_pose_prior(const PoseModel& model, const std::vector<std::vector<double>>& poses, double spread) {
  if (poses.empty()) fail("a prior of poses needs at least one pose");
  const Eigen::Index n = model.num_unknowns();
  PosePrior prior{mean_pose(model, poses), Eigen::MatrixXd::Zero(n, n)};
  Eigen::VectorXd variation = Eigen::VectorXd::Zero(n);
  for (const std::vector<double>& pose : poses) {
    for (Eigen::Index u = 0; u < n; ++u) {
      const std::optional<int> dof = model.dof_of(static_cast<int>(u));
      if (dof && !model.moves_root(*dof)) variation[u] = pose[*dof] - prior.mean[*dof];
    }
    prior.covariance.noalias() += variation * variation.transpose() / static_cast<double>(poses.size());
  }
  for (Eigen::Index u = 0; u < n; ++u) {
    const std::optional<int> dof = model.dof_of(static_cast<int>(u));
    const bool free = !dof || model.moves_root(*dof) || model.reach(*dof) == 0.0;
    prior.covariance(u, u) += free ? kFree : std::pow(spread / model.reach(*dof), 2);
  }
  return prior;
}

}  // namespace doppel
