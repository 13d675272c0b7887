#include "doppel/rigging/joints/move_inside.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "doppel/core/statistics.h"
#include "doppel/rigging/joints/limb_slice.h"
#include "doppel/rigging/weights/heat_domain.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

// All lengths are shares of the trunk: from the middle of the hips to the middle of the shoulders, 0.48 m for an adult.

/// A joint in the middle of a limb, and where the limb is cut to find that middle.
struct LimbJoint {
  const char *name, *above, *below;  ///< `below` is empty at wrist and ankle: the cuts are those of the bone above
  std::array<double, 3> shifts;      ///< of the cuts along the bones
  double largest_radius;             ///< a larger cross-section holds more than the limb
};
constexpr std::array<LimbJoint, 4> kLimbJoints{{{"elbow", "shoulder", "wrist", {-0.03, 0.0, 0.03}, 0.14},
                                                {"wrist", "elbow", "", {-0.08, -0.05, -0.02}, 0.11},
                                                {"knee", "hip", "ankle", {-0.03, 0.0, 0.03}, 0.22},
                                                {"ankle", "knee", "", {-0.12, -0.08, -0.04}, 0.19}}};
constexpr std::array<const char*, 2> kSidePrefixes{"left_", "right_"};

constexpr double kWindow = 0.27;
/// How far the joints of rigs lie from the middle of the limb, and the spread of that.
constexpr double kUsualOffset = 0.029, kOffsetSpread = 0.017;

/// The spread of what proportions say about a position along a limb.
constexpr double kAnkleSpread = 0.02, kKneeSpread = 0.038, kElbowSpread = 0.03, kReachSpread = 0.04,
                 kNarrowSpread = 0.02, kSymmetrySpread = 0.012, kDepthSpread = 0.025, kHipWidthSpread = 0.03,
                 kShoulderWidthSpread = 0.045, kLevelSpread = 0.03;

class Placer {
 public:
  Placer(BodyJoints& joints, const SolidGrid& solid) : joints_(joints), solid_(solid) {
    const auto middle = [&](const char* part) {
      return Vector3d(0.5 * (joints.at(std::string("left_") + part) + joints.at(std::string("right_") + part)));
    };
    // Both pairs together: the direction of a single short line is not exact.
    const Vector3d up = middle("shoulder") - middle("hip");
    frame_.left =
        (joints.at("left_hip") - joints.at("right_hip") + joints.at("left_shoulder") - joints.at("right_shoulder"))
            .normalized();
    frame_.forward = frame_.left.cross(up).normalized();
    frame_.up = frame_.forward.cross(frame_.left);
    trunk_ = up.norm();
  }

  double trunk() const { return trunk_; }

  void run() {
    const BodyJoints given = joints_;
    // The middle of the limbs depends on the directions of the bones, and these on the joints.
    for (int round = 0; round < 3; ++round)
      for (const LimbJoint& limb : kLimbJoints)
        for (const char* side : kSidePrefixes) centre(side, limb);
    error_ = estimate_error(given);
    for (const LimbJoint& limb : kLimbJoints)
      for (const char* side : kSidePrefixes) {
        Vector3d& joint = joints_.positions[side + std::string(limb.name)];
        const Vector3d& before = given.at(side + std::string(limb.name));
        const double share = solid_.is_inside(before) ? trust(kOffsetSpread) : 1.0;
        joint = before + share * (joint - before);
      }
    for (const char* side : kSidePrefixes) {
      centre_depth(joint(side, "hip"));
      centre_depth(joint(side, "shoulder"));
      slide_ankle(side);
      slide_wrist(side);
    }
    even_pair("hip", 0.21, kHipWidthSpread);
    even_pair("shoulder", 0.34, kShoulderWidthSpread);
    even_lengths();
    for (const char* side : kSidePrefixes) {
      slide_middle(side, "hip", "knee", "ankle", 0.485, kKneeSpread);
      slide_middle(side, "shoulder", "elbow", "wrist", 0.498, kElbowSpread);
    }
  }

 private:
  const Vector3d& at(const std::string& side, const char* part) const { return joints_.at(side + part); }
  Vector3d& joint(const std::string& side, const char* part) { return joints_.positions.at(side + part); }

  /// The share of a correction that is made, when the correction itself has a spread.
  double trust(double spread) const { return error_ * error_ / (error_ * error_ + spread * spread); }

  /// Along the limb at a joint.
  Vector3d direction(const std::string& side, const LimbJoint& limb) const {
    const Vector3d& p = at(side, limb.name);
    Vector3d d = (p - at(side, limb.above)).normalized();
    if (*limb.below != '\0') d += (at(side, limb.below) - p).normalized();
    return d.norm() > 1e-6 ? Vector3d(d.normalized()) : Vector3d::UnitY();
  }

  /// Moves a joint to the middle of the limb, perpendicular to the limb.
  void centre(const std::string& side, const LimbJoint& limb) {
    const Vector3d d = direction(side, limb);
    Vector3d& p = joint(side, limb.name);
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (const double shift : limb.shifts) {
      const Vector3d cut = p + shift * trunk_ * d;
      const auto slice = slice_limb(solid_, cut, d, kWindow * trunk_);
      if (!slice || slice->open || slice->radius > limb.largest_radius * trunk_) continue;
      sum += slice->centre - cut;
      ++count;
    }
    if (count > 0) p += sum / count - d * d.dot(sum / count);
  }

  /// The error of the given joints along one axis, as a share of the trunk: what their distances from the middle of
  /// the limbs exceed the usual distance of a rig's joints.
  double estimate_error(const BodyJoints& given) const {
    std::vector<double> squares;
    for (const LimbJoint& limb : kLimbJoints)
      for (const char* side : kSidePrefixes) {
        const double moved = (at(side, limb.name) - given.at(side + std::string(limb.name))).norm() / trunk_;
        if (moved > 0) squares.push_back(moved * moved);
      }
    constexpr double kMedianOfTwoAxes = 1.386;  // of the sum of two squares, in variances
    return std::sqrt(std::max(0.0, median(squares) - kUsualOffset * kUsualOffset) / kMedianOfTwoAxes);
  }

  /// Moves a hip or shoulder forwards or back to the middle of the body there.
  void centre_depth(Vector3d& p) const {
    double sum = 0;
    int count = 0;
    for (const double aside : {-0.03, 0.0, 0.03})
      for (const double above : {-0.03, 0.0, 0.03}) {
        const Vector3d from = p + trunk_ * (aside * frame_.left + above * frame_.up);
        if (!solid_.is_inside(from)) continue;
        sum += 0.5 * (free_way(from, frame_.forward) - free_way(from, -frame_.forward));
        ++count;
      }
    if (count > 4) p += trust(kDepthSpread) * (sum / count) * frame_.forward;
  }

  /// The length of the way inside of the solid.
  double free_way(const Vector3d& from, const Vector3d& along) const {
    const double step = 0.5 * solid_.cell;
    double way = 0;
    while (way < 0.5 * trunk_ && solid_.is_inside(from + (way + step) * along)) way += step;
    return way;
  }

  /// Brings hips or shoulders nearer to the usual distance from each other and to the same height.
  void even_pair(const char* part, double half_width, double spread) {
    Vector3d &left = joint("left_", part), &right = joint("right_", part);
    const Vector3d apart = 0.5 * (left - right);
    const Vector3d move = trust(spread) * (half_width * trunk_ - apart.dot(frame_.left)) * frame_.left -
                          trust(kLevelSpread) * apart.dot(frame_.up) * frame_.up;
    left += move;
    right -= move;
  }

  /// How far the solid reaches beyond a joint along a direction, within a cylinder.
  double reach(const Vector3d& from, const Vector3d& along, double radius, double farthest) const {
    double most = 0;
    for (double t = 0; t < farthest; t += solid_.cell) {
      const auto slice = slice_limb(solid_, from + t * along, along, radius);
      if (slice) most = t;
    }
    return most;
  }

  /// The ankle's height above the sole.
  void slide_ankle(const std::string& side) {
    constexpr double kHeight = 0.173;
    Vector3d& p = joint(side, "ankle");
    const Vector3d down = (p - at(side, "knee")).normalized();
    const double height = reach(p, down, 0.2 * trunk_, 0.5 * trunk_);
    if (height <= 0) return;
    p += trust(kAnkleSpread) * (height - kHeight * trunk_) * down;
  }

  /// The wrist lies where the arm is narrowest, if the shape shows such a position, else by the length of the hand.
  void slide_wrist(const std::string& side) {
    constexpr double kHand = 0.407;
    Vector3d& p = joint(side, "wrist");
    const Vector3d along = (p - at(side, "elbow")).normalized();
    if (const auto narrow = narrowest(p, along)) {
      p += trust(kNarrowSpread) * *narrow * along;
      return;
    }
    const double hand = reach(p, along, 0.2 * trunk_, 0.8 * trunk_);
    if (hand > 0.2 * trunk_) p += trust(kReachSpread) * (hand - kHand * trunk_) * along;
  }

  /// Where a limb is narrowest near a point, metres along the limb; nothing if it is not wider on both sides.
  std::optional<double> narrowest(const Vector3d& p, const Vector3d& along) const {
    const double step = 0.02 * trunk_;
    constexpr int kReach = 9;
    std::vector<double> radius;
    for (int i = -kReach; i <= kReach; ++i) {
      const auto slice = slice_limb(solid_, p + i * step * along, along, kWindow * trunk_);
      radius.push_back(slice && !slice->open ? slice->radius : 1e3);
    }
    constexpr int kEdge = 4;
    int best = kEdge;
    for (int i = kEdge; i + kEdge < static_cast<int>(radius.size()); ++i)
      if (radius[i] < radius[best]) best = i;
    const double before = radius[best - kEdge], after = radius[best + kEdge];
    if (before > 0.2 * trunk_ || after > 0.2 * trunk_ || before < 1.06 * radius[best] || after < 1.15 * radius[best])
      return std::nullopt;
    return (best - kReach) * step;
  }

  /// Moves the ends of bones along the bone until both sides have the same length.
  void even_lengths() {
    constexpr std::array<std::array<const char*, 2>, 4> kBones{
        {{"hip", "knee"}, {"knee", "ankle"}, {"shoulder", "elbow"}, {"elbow", "wrist"}}};
    for (const auto& [from, to] : kBones) {
      const Vector3d left = at("left_", to) - at("left_", from), right = at("right_", to) - at("right_", from);
      const double half = 0.5 * trust(kSymmetrySpread) * (left.norm() - right.norm());
      joint("left_", to) -= 0.5 * half * left.normalized();
      joint("left_", from) += 0.5 * half * left.normalized();
      joint("right_", to) += 0.5 * half * right.normalized();
      joint("right_", from) -= 0.5 * half * right.normalized();
    }
  }

  /// Moves knee or elbow along its limb towards the usual ratio of the two bones.
  void slide_middle(const std::string& side, const char* above, const char* part, const char* below, double share,
                    double spread) {
    Vector3d& p = joint(side, part);
    const double upper = (p - at(side, above)).norm(), lower = (at(side, below) - p).norm();
    const Vector3d along = (at(side, below) - at(side, above)).normalized();
    p += trust(spread) * (share * (upper + lower) - upper) * along;
  }

  BodyJoints& joints_;
  const SolidGrid& solid_;
  BodyFrame frame_;
  double trunk_ = 0, error_ = 0;
};

/// Moves a joint that lies outside to the nearest cell that is a little below the surface.
void pull_inside(Vector3d& joint, const SolidGrid& solid, const std::vector<float>& depth, double farthest) {
  const Eigen::Vector3i c = solid.cell_of(joint);
  const int reach = static_cast<int>(std::ceil(farthest / solid.cell));
  double nearest = farthest;
  const Vector3d from = joint;
  for (int z = c.z() - reach; z <= c.z() + reach; ++z)
    for (int y = c.y() - reach; y <= c.y() + reach; ++y)
      for (int x = c.x() - reach; x <= c.x() + reach; ++x) {
        if (!solid.is_inside(x, y, z) || depth[solid.index(x, y, z)] < 1.9 * solid.cell) continue;
        const double away = (solid.centre(x, y, z) - from).norm();
        if (away >= nearest) continue;
        nearest = away;
        joint = solid.centre(x, y, z);
      }
}

}  // namespace

void move_inside(BodyJoints& joints, const SolidGrid& solid) {
  constexpr double kAdultTrunk = 0.48, kMaxMove = 0.06;  // metres
  const BodyJoints given = joints;
  Placer placer(joints, solid);
  placer.run();
  const double most = kMaxMove * placer.trunk() / kAdultTrunk;
  for (auto& [name, position] : joints.positions) {
    const Vector3d move = position - given.at(name);
    if (move.norm() > most) position = given.at(name) + most * move.normalized();
  }
  const std::vector<float> depth = distance_to_outside(solid);
  for (const std::string& name : body_joint_names())
    if (joints.has(name) && !solid.is_inside(joints.at(name))) pull_inside(joints.positions[name], solid, depth, most);
}

}  // namespace doppel
