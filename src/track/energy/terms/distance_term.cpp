#include "doppel/track/energy/terms/distance_term.h"

namespace doppel {

void DistanceTerm::evaluate(const ShapeModel& model, const PosedShape& shape, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  for (const Pair& pair : pairs_) {
    const Eigen::Vector3d apart = model.landmark(shape, pair.landmarks[0]) - model.landmark(shape, pair.landmarks[1]);
    const double distance = apart.norm();
    const Eigen::Index row = rows.add_group(weight_ * pair.weight);
    rows.value(row) = distance - pair.distance;
    if (!jacobian || distance == 0.0) continue;
    model.add_landmark_jacobian(shape, pair.landmarks[0], apart / distance, rows.jacobian(row));
    model.add_landmark_jacobian(shape, pair.landmarks[1], -apart / distance, rows.jacobian(row));
  }
}

}  // namespace doppel
