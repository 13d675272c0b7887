#include "doppel/io/rig_import/rig_frame.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/geometry/up_axis.h"

namespace doppel {

namespace {

/// Height of a person, metres; outside it the unit is doubtful.
constexpr double kMinPerson = 0.5, kMaxPerson = 2.5;

double height_of(const std::vector<Eigen::Vector3d>& vertices, const Eigen::Vector3d& up) {
  double low = INFINITY, high = -INFINITY;
  for (const Eigen::Vector3d& vertex : vertices) {
    low = std::min(low, up.dot(vertex));
    high = std::max(high, up.dot(vertex));
  }
  return vertices.empty() ? 0.0 : high - low;
}

}  // namespace

Eigen::Affine3d character_from_scene(const Scene& scene, const std::vector<Eigen::Vector3d>& points,
                                     std::optional<double> metres_per_unit, std::optional<char> up,
                                     std::vector<std::string>& warnings) {
  const Eigen::Matrix3d turn = y_up_from_axis(Eigen::Vector3d::Unit((up ? *up : scene.up.value_or('y')) - 'x'));
  const double height = height_of(points, turn.row(1).transpose());
  if (!(height > 0)) fail("the figure has no height, so its unit and its posture are unknown");
  double unit = metres_per_unit ? *metres_per_unit : scene.metres_per_unit.value_or(0.0);
  for (const double candidate : {1.0, 0.01, 0.001, 0.0254})
    if (unit == 0.0 && height * candidate >= kMinPerson && height * candidate <= kMaxPerson) unit = candidate;
  if (unit == 0.0) unit = 1.0;
  if (height * unit < kMinPerson || height * unit > kMaxPerson)
    warnings.push_back(fmt::format(
        "the figure is {:.3g} m tall in the unit of {:.4g} m; if that is wrong, give the unit", height * unit, unit));
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  result.linear() = unit * turn;
  return result;
}

}  // namespace doppel
