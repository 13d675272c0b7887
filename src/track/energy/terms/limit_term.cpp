#include "doppel/track/energy/terms/limit_term.h"

#include <algorithm>

namespace doppel {

void LimitTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const std::optional<int> dof = model.dof_of(u);
    if (!dof) continue;
    const auto& limits = model.character().skeleton.dofs[*dof].limits;
    if (!limits) continue;
    const double value = body.dofs[*dof];
    const double beyond = value - std::clamp(value, (*limits)[0], (*limits)[1]);
    if (beyond == 0.0) continue;
    const Eigen::Index row = rows.add_group(weight_);
    rows.value(row) = model.reach(*dof) * beyond;
    if (jacobian) rows.jacobian(row)[u] = model.reach(*dof);
  }
}

}  // namespace doppel
