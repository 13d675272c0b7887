#include "doppel/synth/body_field.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

double torso(const Vector3d& p) {
  double d = ellipsoid(p, {0, 1.27, -0.005}, {0.158, 0.205, 0.112});
  d = smooth_min(d, ellipsoid(p, {0, 1.075, -0.002}, {0.136, 0.15, 0.097}), 0.08);
  d = smooth_min(d, ellipsoid(p, {0, 0.93, -0.01}, {0.158, 0.125, 0.118}), 0.06);
  const Vector3d q(std::abs(p.x()), p.y(), p.z());
  d = smooth_min(d, round_cone(q, {0.03, 1.42, -0.02}, BodyPlan::shoulder(), 0.055, 0.056), 0.06);
  d = smooth_min(d, ellipsoid(q, {0.066, 1.285, 0.075}, {0.06, 0.058, 0.052}), 0.05);
  return d;
}

double head(const Vector3d& p) {
  double d = ellipsoid(p, {0, 1.637, 0.012}, {0.074, 0.108, 0.093});
  d = smooth_min(d, ellipsoid(p, {0, 1.583, 0.04}, {0.05, 0.06, 0.058}), 0.04);
  d = smooth_min(d, round_cone(p, {0, 1.645, 0.1}, {0, 1.612, 0.119}, 0.009, 0.0135), 0.018);
  d = smooth_min(d, ellipsoid({std::abs(p.x()), p.y(), p.z()}, {0.078, 1.625, 0.0}, {0.011, 0.03, 0.018}), 0.012);
  return smooth_min(d, round_cone(p, {0, 1.42, -0.018}, {0, 1.575, -0.002}, 0.056, 0.05), 0.03);
}

double hair(const Vector3d& p) {
  double d = ellipsoid(p, {0, 1.655, -0.008}, {0.088, 0.105, 0.101});
  d = smooth_min(d, ellipsoid(p, {0, 1.60, -0.045}, {0.072, 0.09, 0.06}), 0.03);
  // The hairline: the cap of hair is cut off in front of an inclined plane, so that the face is free.
  const double face = Vector3d(0, -0.66, 0.75).dot(p - Vector3d(0, 1.683, 0.06));
  d = smooth_max(d, face, 0.015);
  return smooth_min(d, ellipsoid(p, {0, 1.685, -0.125}, {0.05, 0.046, 0.043}), 0.02);
}

double hand(const Vector3d& p) {
  const Vector3d along = BodyPlan::arm_direction(), thick = along.cross(Vector3d::UnitZ()).normalized(),
                 wide = thick.cross(along);
  const Vector3d q = p - BodyPlan::wrist();
  const Vector3d local(q.dot(along), q.dot(wide), q.dot(thick));
  double d = ellipsoid(local, {0.055, 0.0, 0.0}, {0.068, 0.044, 0.023});
  d = smooth_min(d, ellipsoid(local, {0.118, -0.003, 0.005}, {0.062, 0.037, 0.0165}), 0.03);
  const double side = wide.z() > 0 ? 1 : -1;
  return smooth_min(d, round_cone(local, {0.03, side * 0.026, 0.004}, {0.092, side * 0.06, 0.012}, 0.017, 0.0115),
                    0.016);
}

double foot(const Vector3d& p) {
  const Vector3d heel(0.105, 0.043, -0.052), ball(0.12, 0.04, 0.1);
  double d = round_cone(p, heel, ball, 0.044, 0.047);
  d = smooth_min(d, ellipsoid(p, {0.124, 0.03, 0.142}, {0.046, 0.036, 0.062}), 0.03);
  d = smooth_min(d, round_cone(p, BodyPlan::ankle(), {0.108, 0.15, -0.02}, 0.046, 0.044), 0.03);
  return smooth_max(d, -p.y(), 0.012);
}

double shin(const Vector3d& p) {
  const Vector3d calf(0.104, 0.36, -0.018);
  const double d = round_cone(p, BodyPlan::knee(), BodyPlan::ankle(), 0.062, 0.05);
  return smooth_min(d, ellipsoid(p, calf, {0.06, 0.13, 0.062}), 0.04);
}

/// Distance to a part of the left limbs.
double left_limb(int part, const Vector3d& p) {
  switch (part) {
    case kLeftArm:
      return smooth_min(round_cone(p, BodyPlan::shoulder(), BodyPlan::elbow(), 0.061, 0.051),
                        ellipsoid(p, BodyPlan::shoulder(), {0.063, 0.06, 0.061}), 0.03);
    case kLeftForearm:
      return round_cone(p, BodyPlan::elbow(), BodyPlan::wrist(), 0.047, 0.0305);
    case kLeftHand:
      return hand(p);
    case kLeftThigh:
      return round_cone(p, BodyPlan::hip(), BodyPlan::knee(), 0.092, 0.062);
    case kLeftShin:
      return shin(p);
    default:
      return foot(p);
  }
}

/// How far p is from the axis of the skirt, and how far the outer face of the skirt is: a bell with folds that grow
/// towards the hem.
struct Bell {
  explicit Bell(const Vector3d& p) {
    const double drop = std::clamp((BodyPlan::kWaist - p.y()) / (BodyPlan::kWaist - BodyPlan::kHem), -0.1, 1.1);
    const double down = std::max(drop, 0.0);
    const double angle = std::atan2(p.x(), p.z());
    const double folds = 0.02 * down * down * std::cos(9 * angle + 0.4) + 0.008 * down * std::cos(5 * angle - 0.9);
    radius = 0.118 + 0.078 * std::sqrt(down + 0.004) + 0.128 * down + folds;
    rho = std::hypot(p.x() / 1.13, p.z() + 0.008 * down);
  }
  double rho, radius;
};

/// The bell, hollow from below.
double skirt(const Vector3d& p) {
  const auto [rho, radius] = Bell(p);
  const double outer = (rho - radius) * 0.9;
  const double inner = (rho - (radius - 0.034)) * 0.9;
  // The cavity ends below the waist; above it the garment and the body are one solid.
  const double cavity = smooth_max(inner, p.y() - (BodyPlan::kHem + 0.17), 0.04);
  double d = smooth_max(outer, -cavity, 0.02);
  d = smooth_max(d, BodyPlan::kHem - p.y(), 0.018);
  return smooth_max(d, p.y() - (BodyPlan::kWaist + 0.01), 0.03);
}

}  // namespace

double BodyField::part_distance(Part part, const Vector3d& p) const {
  switch (part) {
    case kTorso:
      return torso(p);
    case kSkirt:
      return skirt(p);
    case kHead:
      return head(p);
    case kHair:
      return hair(p);
    default:
      return part < kRightArm ? left_limb(part, p) : left_limb(part - kLimbParts, mirrored(p));
  }
}

std::array<double, kNumParts> BodyField::part_distances(const Vector3d& p) const {
  std::array<double, kNumParts> d;
  for (int part = 0; part < kNumParts; ++part) d[part] = part_distance(static_cast<Part>(part), p);
  return d;
}

double BodyField::skirt_depth(const Vector3d& p) const {
  const auto [rho, radius] = Bell(p);
  return radius - rho;
}

double BodyField::distance(const Vector3d& p) const { return joined(part_distances(p)); }

double BodyField::joined(const std::array<double, kNumParts>& part) {
  double d = smooth_min(part[kTorso], part[kHead], 0.035);
  d = smooth_min(d, part[kHair], 0.008);
  for (const int side : {kLeftArm, kRightArm}) {
    double arm = smooth_min(part[side], part[side + 1], 0.025);
    arm = smooth_min(arm, part[side + 2], 0.02);
    d = smooth_min(d, arm, 0.05);
    double leg = smooth_min(part[side + 3], part[side + 4], 0.03);
    leg = smooth_min(leg, part[side + 5], 0.02);
    d = smooth_min(d, leg, 0.03);
  }
  return smooth_min(d, part[kSkirt], 0.022);
}

DistanceField BodyField::field() {
  return [](const Vector3d& p) { return BodyField().distance(p); };
}

Vector3d BodyField::gradient(const Vector3d& p) const { return field_gradient(field(), p); }

Part BodyField::part(const Vector3d& p) const {
  auto d = part_distances(p);
  d[kHair] -= 0.002;  // where hair and skull coincide, the surface is hair
  return static_cast<Part>(std::min_element(d.begin(), d.end()) - d.begin());
}

double BodyField::openness(const Vector3d& p, const Vector3d& normal) const {
  double blocked = 0, weight = 1, total = 0;
  for (const double reach : {0.015, 0.04, 0.08, 0.14}) {
    blocked += weight * std::clamp((reach - distance(p + reach * normal)) / reach, 0.0, 1.0);
    total += weight;
    weight *= 0.8;
  }
  return 1 - blocked / total;
}

PartAxis part_axis(Part part) {
  const bool right = part >= kRightArm;
  const auto axis = [&](const Vector3d& from, const Vector3d& to, double radius) {
    return PartAxis{right ? mirrored(from) : from, right ? mirrored(to) : to, radius};
  };
  switch (right ? part - kLimbParts : part) {
    case kTorso:
      return axis({0, 0.9, 0}, {0, 1.4, 0}, 0.15);
    case kLeftArm:
      return axis(BodyPlan::shoulder(), BodyPlan::elbow(), 0.07);
    case kLeftForearm:
      return axis(BodyPlan::elbow(), BodyPlan::wrist(), 0.06);
    case kLeftHand:
      return axis(BodyPlan::wrist(), BodyPlan::fingertip(), 0.06);
    case kLeftThigh:
      return axis(BodyPlan::hip(), BodyPlan::knee(), 0.1);
    case kLeftShin:
      return axis(BodyPlan::knee(), BodyPlan::ankle(), 0.08);
    case kLeftFoot:
      return axis({0.107, 0.1, -0.06}, BodyPlan::toe(), 0.1);
    default:
      fail("the body part {} has no axis", static_cast<int>(part));
  }
}

}  // namespace doppel::synth
