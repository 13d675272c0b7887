#include "doppel/track/surface/outline_term.h"

#include "doppel/core/as_size.h"
#include "doppel/solver/residuals.h"

namespace doppel {

OutlineTerm::OutlineTerm(const Evidence& evidence, std::vector<OutlineVertex> outline, double weight, double scale)
    : evidence_(evidence),
      outline_(std::move(outline)),
      weight_(weight),
      scale_(scale),
      weights_(evidence.normals.size(), 0.0),
      targets_(evidence.normals.size(), 0.0) {}

void OutlineTerm::freeze(const SurfacePoints& vertices) {
  const RobustKernel kernel = RobustKernel::geman_mcclure_of(scale_);
  const double pixels = reference_pixels(evidence_.camera);
  for (const auto& [camera, vertex, own_distance] : outline_) {
    const auto v = as_size(vertex);
    weights_[v] = 0.0;
    targets_[v] = own_distance;
    const auto projected = project_with_jacobian(evidence_.camera, vertices.col(vertex));
    if (!projected || !evidence_.parts.allows(evidence_.vertex_part[v], projected->pixel)) continue;
    const OutlineField::Sample sample = evidence_.field.at(projected->pixel);
    const double distance = pixels * sample.distance;
    weights_[v] = weight_ * kernel.weight(distance * distance);
    if (belongs_to_opposite_outline(*projected, evidence_.normals[v], sample))
      targets_[v] = 2.0 * distance - own_distance;
  }
}

PointRows OutlineTerm::rows(int vertex, const SurfacePoints& vertices) const {
  const auto v = as_size(vertex);
  PointRows rows;
  if (weights_[v] == 0.0) return rows;
  rows.count = 1;
  rows.weight = weights_[v];
  const auto projected = project_with_jacobian(evidence_.camera, vertices.col(vertex));
  if (!projected) {
    rows.values[0] = kBehindCamera;
    return rows;
  }
  const OutlineField::Sample sample = evidence_.field.at(projected->pixel);
  const double pixels = reference_pixels(evidence_.camera);
  rows.values[0] = pixels * sample.distance - targets_[v];
  rows.jacobian.row(0) = pixels * sample.gradient.transpose() * projected->jacobian;
  return rows;
}

}  // namespace doppel
