#include "doppel/rigging/joints/hinge_volume.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "doppel/rigging/joints/hinges.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr double kBentHinge = 2.2;      // radians
constexpr double kStrongestTilt = 1.2;  // c; the closeness keeps the transition monotonic below 1.35
constexpr double kReachOfTilt = 2.5;    // of the closeness, in radii of the limb
constexpr double kMiddleOfLimb = 0.25;  // of the piece on both sides of the joint, where its middle is measured
constexpr double kOneBoneOnly = 1e-6;   // weight that stays as it is
constexpr int kHalvings = 20;

/// A hinge and the part of the surface around it.
class BendingLimb {
 public:
  BendingLimb(const WeightField& field, const Character& character, const Hinge& hinge)
      : field_(field),
        rest_(character.mesh.vertices),
        hinge_(hinge),
        piece_(rest_, character.mesh.faces, members_of_limb(field, hinge), hinge.positions) {
    const Vector3d upper = hinge.positions.joint - hinge.positions.top,
                   lower = hinge.positions.end - hinge.positions.joint;
    along_ = (upper.normalized() + lower.normalized()).normalized();
    inner_ = hinge.axis.cross(along_).normalized();
    measure(kMiddleOfLimb * 0.5 * (upper.norm() + lower.norm()));
  }

  /// Whether the surface around the joint is that of a limb.
  bool is_limb() const { return radius_ > 0.0; }

  /// The weight of the bones below the hinge.
  double weight(int vertex) const {
    double sum = 0.0;
    for (std::size_t b = 0; b < hinge_.below.size(); ++b)
      if (hinge_.below[b]) sum += double{field_(vertex, static_cast<Eigen::Index>(b))};
    return std::clamp(sum, 0.0, 1.0);
  }

  /// w^q / (w^q + (1 - w)^q), see keep_hinge_volumes. @param c strength
  double tilted(int vertex, double weight, double c) const {
    if (weight < kOneBoneOnly || weight > 1.0 - kOneBoneOnly) return weight;
    const Vector3d p = rest_[vertex] - hinge_.positions.joint;
    const double side = std::clamp(((p - middle_).dot(inner_)) / radius_, -1.0, 1.0);
    const double away = p.dot(along_) / (kReachOfTilt * radius_);
    const double power = std::exp(c * side * std::exp(-0.5 * away * away));
    return 1.0 / (1.0 + std::pow((1.0 - weight) / weight, power));
  }

  /// The strength with which the bent limb has the volume of the rest pose, or the strongest one allowed.
  double best_tilt() const {
    const double rest_volume = piece_.volume(rest_);
    double low = -kStrongestTilt, high = kStrongestTilt;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (low + high);
      (bent_volume(middle) < rest_volume ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

 private:
  static std::vector<bool> members_of_limb(const WeightField& field, const Hinge& hinge) {
    std::vector<bool> members;
    for (Eigen::Index v = 0; v < field.rows(); ++v) members.push_back(field(v, hinge.limb).sum() > 0.5F);
    return members;
  }

  /// Finds the middle of the limb and its radius from the triangles near the joint.
  void measure(double window) {
    double area = 0.0, square = 0.0;
    std::vector<std::pair<double, Vector3d>> near;
    for (const Triangle& face : piece_.faces()) {
      const Vector3d &a = rest_[face[0]], &b = rest_[face[1]], &c = rest_[face[2]];
      const Vector3d centre = (a + b + c) / 3.0 - hinge_.positions.joint;
      if (std::abs(centre.dot(along_)) > window) continue;
      near.emplace_back(0.5 * (b - a).cross(c - a).norm(), centre);
      area += near.back().first;
      middle_ += near.back().first * near.back().second;
    }
    if (!(area > 0.0)) return;
    middle_ /= area;
    for (const auto& [weight, centre] : near) square += weight * (centre - middle_).cross(along_).squaredNorm();
    radius_ = std::sqrt(square / area);
  }

  double bent_volume(double c) const {
    std::vector<Vector3d> bent = rest_;
    for (const int v : piece_.vertices()) {
      const Eigen::AngleAxisd turn(kBentHinge * tilted(v, weight(v), c), hinge_.axis);
      bent[v] = hinge_.positions.joint + turn * (rest_[v] - hinge_.positions.joint);
    }
    return piece_.volume(bent);
  }

  const WeightField& field_;
  const std::vector<Vector3d>& rest_;
  const Hinge& hinge_;
  LimbPiece piece_;
  Vector3d along_, inner_, middle_ = Vector3d::Zero();  ///< the middle from the joint
  double radius_ = 0.0;
};

/// Gives the bones below the hinge another weight together; the shares among them and among the others stay.
void set_weight_below(WeightField& field, int vertex, const std::vector<bool>& below, double before, double after) {
  if (before == after) return;
  const auto more = static_cast<float>(after / before), less = static_cast<float>((1.0 - after) / (1.0 - before));
  for (std::size_t b = 0; b < below.size(); ++b) field(vertex, static_cast<Eigen::Index>(b)) *= below[b] ? more : less;
}

}  // namespace

void keep_hinge_volumes(WeightField& field, const Character& character) {
  for (const Hinge& hinge : find_hinges(character)) {
    const BendingLimb limb(field, character, hinge);
    if (!limb.is_limb()) continue;
    const double c = limb.best_tilt();
    for (int v = 0; v < static_cast<int>(field.rows()); ++v) {
      const double weight = limb.weight(v);
      set_weight_below(field, v, hinge.below, weight, limb.tilted(v, weight, c));
    }
  }
}

}  // namespace doppel
