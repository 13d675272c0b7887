#include "doppel/track/surface/photometric_term.h"

#include <algorithm>

#include "doppel/solver/parallel.h"
#include "doppel/track/energy/evidence.h"

namespace doppel {

PhotometricTerm::PhotometricTerm(const PinholeCamera& camera, const ColourPyramid& pyramid,
                                 const std::vector<char>& visible, const Eigen::Matrix3Xd& colours, double weight,
                                 double threshold)
    : camera_(camera),
      pyramid_(pyramid),
      visible_(visible),
      colours_(colours),
      weight_(weight),
      threshold_(threshold),
      used_(visible.size(), 0) {}

void PhotometricTerm::freeze(const SurfacePoints& vertices) {
  for_parts(visible_.size(), [&](std::size_t first, std::size_t last) {
    ColourPyramid::Sample sample;
    for (std::size_t i = first; i < last; ++i) {
      used_[i] = 0;
      if (!visible_[i]) continue;
      const auto column = static_cast<Eigen::Index>(i);
      const auto projected = project_with_jacobian(camera_, vertices.col(column));
      used_[i] = projected && pyramid_.at(level_, projected->pixel, sample) &&
                 (sample.colour - colours_.col(column)).norm() <= threshold_;
    }
  });
}

int PhotometricTerm::num_used() const { return static_cast<int>(std::count(used_.begin(), used_.end(), 1)); }

PointRows PhotometricTerm::rows(int vertex, const SurfacePoints& vertices) const {
  PointRows rows;
  if (!used_[vertex]) return rows;
  rows.count = 3;
  rows.weight = weight_;
  const auto projected = project_with_jacobian(camera_, vertices.col(vertex));
  ColourPyramid::Sample sample;
  if (!projected || !pyramid_.at(level_, projected->pixel, sample)) {
    rows.values[0] = threshold_;  // it left the image during the step: the largest allowed difference
    return rows;
  }
  rows.values = sample.colour - colours_.col(vertex);
  rows.jacobian = sample.jacobian * projected->jacobian;
  return rows;
}

}  // namespace doppel
