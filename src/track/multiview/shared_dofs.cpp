#include "doppel/track/multiview/shared_dofs.h"

#include <algorithm>

namespace doppel {

void SharedDofs::put_into(std::vector<double>& pose) const {
  for (std::size_t i = 0; i < dofs.size(); ++i) pose[dofs[i]] = values[i];
}

std::vector<double> prior_weights(const SharedDofs& shared, double prior_weight, std::size_t num_dofs) {
  std::vector<double> weights(num_dofs, prior_weight);
  for (const int dof : shared.dofs) {
    double& weight = weights[dof];
    weight = std::max(weight, shared.weight);
  }
  const bool held = std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0.0; });
  return held ? weights : std::vector<double>();
}

}  // namespace doppel
