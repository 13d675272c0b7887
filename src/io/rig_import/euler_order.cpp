#include "doppel/io/rig_import/euler_order.h"

#include <algorithm>
#include <cmath>

namespace doppel {

namespace {

constexpr double kTurn = 2 * M_PI;
/// A middle angle up to which the preferred order is kept.
constexpr double kFarFromPole = 70 * M_PI / 180;

/// +1 if the axes follow one another as x, y, z do, else -1.
double handedness(const EulerOrder& order) { return (order[1] - order[0] + 3) % 3 == 1 ? 1.0 : -1.0; }

double middle_angle(const Eigen::Matrix3d& rotation, const EulerOrder& order) {
  const auto [a, b, c] = order;
  return std::atan2(handedness(order) * rotation(a, c), std::hypot(rotation(a, a), rotation(a, b)));
}

/// The angle that differs from `angle` by whole turns and is nearest to `before`.
double nearest_turn(double angle, double before) { return angle - kTurn * std::round((angle - before) / kTurn); }

}  // namespace

Eigen::Vector3d euler_angles(const Eigen::Matrix3d& rotation, const EulerOrder& order, const Eigen::Vector3d& before) {
  const auto [a, b, c] = order;
  const double sign = handedness(order), middle = middle_angle(rotation, order);
  if (std::hypot(rotation(a, a), rotation(a, b)) < 1e-7) {
    // At the pole only the sum or difference of the outer angles is known: the last keeps its value.
    const Eigen::Matrix3d rest = rotation * Eigen::AngleAxisd(-before[2], Eigen::Vector3d::Unit(c)).toRotationMatrix();
    return {nearest_turn(std::atan2(sign * rest(c, b), rest(b, b)), before[0]), middle, before[2]};
  }
  const double outer = std::atan2(-sign * rotation(b, c), rotation(c, c));
  const double inner = std::atan2(-sign * rotation(a, b), rotation(a, a));
  const Eigen::Vector3d first(nearest_turn(outer, before[0]), nearest_turn(middle, before[1]),
                              nearest_turn(inner, before[2]));
  const Eigen::Vector3d second(nearest_turn(outer + M_PI, before[0]), nearest_turn(M_PI - middle, before[1]),
                               nearest_turn(inner + M_PI, before[2]));
  return (first - before).squaredNorm() <= (second - before).squaredNorm() ? first : second;
}

EulerOrder choose_euler_order(const std::vector<Eigen::Quaterniond>& rotations, const EulerOrder& preferred) {
  static const std::array<EulerOrder, 6> kOrders{{{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  const auto largest = [&](const EulerOrder& order) {
    double angle = 0.0;
    for (const Eigen::Quaterniond& rotation : rotations)
      angle = std::max(angle, std::abs(middle_angle(rotation.toRotationMatrix(), order)));
    return angle;
  };
  if (largest(preferred) <= kFarFromPole) return preferred;
  return *std::min_element(kOrders.begin(), kOrders.end(),
                           [&](const EulerOrder& a, const EulerOrder& b) { return largest(a) < largest(b); });
}

}  // namespace doppel
