#include "doppel/track/energy/terms/shape_prior_term.h"

namespace doppel {

void ShapePriorTerm::evaluate(const ShapeModel& model, const PosedShape& shape, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  for (int p = 0; p < model.num_unknowns(); ++p) {
    const ShapeParameter& usual = model.family().parameters()[p];
    const Eigen::Index row = rows.add_group(weight_);
    rows.value(row) = (shape.shapes->parameters[p] - usual.mean) / usual.deviation;
    if (jacobian) rows.jacobian(row)[p] = 1.0 / usual.deviation;
  }
}

}  // namespace doppel
