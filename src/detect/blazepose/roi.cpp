#include "doppel/detect/blazepose/roi.h"

#include <cmath>
#include <numbers>

namespace doppel {

namespace {

constexpr double kRoiMargin = 1.25;

double wrapped(double angle) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return angle - kTurn * std::floor((angle + std::numbers::pi) / kTurn);
}

}  // namespace

bool BodyRoi::valid() const {
  return centre.allFinite() && std::abs(centre.x()) < 1e6 && std::abs(centre.y()) < 1e6 && side > 1e-3 && side < 1e6 &&
         std::isfinite(rotation);
}

Eigen::Matrix2d BodyRoi::axes() const {
  const double c = std::cos(rotation), s = std::sin(rotation), right = mirrored ? -1.0 : 1.0;
  return (Eigen::Matrix2d() << right * c, -s, right * s, c).finished();
}

Eigen::Vector2d BodyRoi::image_from_roi(const Eigen::Vector2d& point) const {
  return centre + axes() * (point - Eigen::Vector2d(0.5, 0.5)) * side;
}

Eigen::Vector2d BodyRoi::roi_from_image(const Eigen::Vector2d& pixel) const {
  return axes().transpose() * (pixel - centre) / side + Eigen::Vector2d(0.5, 0.5);
}

double upright_rotation(const Eigen::Vector2d& up) {
  return wrapped(0.5 * std::numbers::pi - std::atan2(-up.y(), up.x()));
}

BodyRoi body_roi(const Eigen::Vector2d& centre, const Eigen::Vector2d& rim) {
  const Eigen::Vector2d up = rim - centre;
  return {centre, 2.0 * up.norm() * kRoiMargin, upright_rotation(up)};
}

}  // namespace doppel
