#include "doppel/track/energy/terms/floor_term.h"

#include <cmath>

namespace doppel {

FloorTerm::FloorTerm(std::vector<Sole> soles, double weight, double slide, const RobustKernel& kernel)
    : soles_(std::move(soles)), weight_(weight), scale_(std::sqrt(slide), 1.0, std::sqrt(slide)), kernel_(kernel) {}

void FloorTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  rows.reset(model.num_unknowns(), 3, kernel_, jacobian);
  for (const Sole& sole : soles_) {
    const Eigen::Index first = rows.add_group(weight_);
    const Eigen::Vector3d stands(sole.last.x(), sole.height, sole.last.z());
    const Eigen::Vector3d error = scale_.cwiseProduct(model.landmark(body, sole.landmark) - stands);
    for (int i = 0; i < 3; ++i) {
      rows.value(first + i) = error[i];
      if (jacobian)
        model.add_landmark_jacobian(body, sole.landmark, scale_[i] * Eigen::Vector3d::Unit(i),
                                    rows.jacobian(first + i));
    }
  }
}

}  // namespace doppel
