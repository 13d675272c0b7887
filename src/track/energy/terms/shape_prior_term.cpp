#include "doppel/track/energy/terms/shape_prior_term.h"

#include "doppel/core/as_size.h"

namespace doppel {

void ShapePriorTerm::evaluate(const ShapeModel& model, const PosedShape& shape, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  for (int p = 0; p < model.num_unknowns(); ++p) {
    const ShapeParameter& usual = model.family().parameters()[as_size(p)];
    const Eigen::Index row = rows.add_group(weight_);
    rows.value(row) = (shape.shapes->parameters[as_size(p)] - usual.mean) / usual.deviation;
    if (jacobian) rows.jacobian(row)[p] = 1.0 / usual.deviation;
  }
}

}  // namespace doppel
