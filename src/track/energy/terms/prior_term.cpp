#include "doppel/track/energy/terms/prior_term.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {

PriorTerm::PriorTerm(std::string name, std::vector<double> centre, double weight)
    : name_(std::move(name)), centre_(std::move(centre)), weights_(centre_.size(), weight) {}

PriorTerm::PriorTerm(std::string name, std::vector<double> centre, std::vector<double> weights)
    : name_(std::move(name)), centre_(std::move(centre)), weights_(std::move(weights)) {}

void PriorTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const std::optional<int> dof = model.dof_of(u);
    if (!dof || model.moves_root(*dof)) continue;
    const auto d = as_size(*dof);
    const Eigen::Index row = rows.add_group(weights_[d]);
    rows.value(row) = model.reach(*dof) * (body.dofs[d] - centre_[d]);
    if (jacobian) rows.jacobian(row)[u] = model.reach(*dof);
  }
}

}  // namespace doppel
