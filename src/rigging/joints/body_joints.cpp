#include "doppel/rigging/joints/body_joints.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

std::vector<std::string> both_sides(const std::vector<std::string>& parts) {
  std::vector<std::string> names;
  for (const std::string& part : parts)
    for (const char* side : {"left_", "right_"}) names.push_back(side + part);
  return names;
}

Vector3d middle(const BodyJoints& joints, const std::string& part) {
  return 0.5 * (joints.at("left_" + part) + joints.at("right_" + part));
}

BodyFrame frame_of(const Vector3d& left, const Vector3d& up) {
  if (!(left.norm() > 1e-6) || !(up.norm() > 1e-6) || !(left.normalized().cross(up.normalized()).norm() > 1e-3))
    fail(
        "the joints of a body: hips and shoulders must be apart from each other, found left ({}, {}, {}) and up "
        "({}, {}, {}) metres",
        left.x(), left.y(), left.z(), up.x(), up.y(), up.z());
  BodyFrame frame;
  frame.left = left.normalized();
  frame.forward = frame.left.cross(up).normalized();
  frame.up = frame.forward.cross(frame.left);
  return frame;
}

/// Adds a point unless it is known.
void add_missing(BodyJoints& joints, const std::string& name, const Vector3d& position) {
  joints.positions.emplace(name, position);
}

/// Pelvis to head. `t` counts from the middle of the hips (0) to the middle of the shoulders (1); the spine lies behind
/// that line.
void complete_trunk(BodyJoints& joints) {
  const Vector3d hips = middle(joints, "hip"), shoulders = middle(joints, "shoulder"), trunk = shoulders - hips;
  const BodyFrame low = pelvis_frame(joints), high = chest_frame(joints);
  const double length = trunk.norm();
  add_missing(joints, "pelvis", hips + 0.08 * trunk);
  add_missing(joints, "spine", hips + 0.27 * trunk - 0.02 * length * low.forward);
  add_missing(joints, "chest", hips + 0.70 * trunk - 0.06 * length * high.forward);
  add_missing(joints, "neck", shoulders + length * (0.14 * high.up - 0.03 * high.forward));
  add_missing(joints, "head", joints.at("neck") + length * (0.17 * high.up + 0.03 * high.forward));
  add_missing(joints, "head_top", joints.at("head") + length * (0.36 * high.up + 0.02 * high.forward));
  for (const std::string side : {"left_", "right_"}) {
    const Vector3d& shoulder = joints.at(side + "shoulder");
    add_missing(joints, side + "clavicle", shoulders + 0.2 * (shoulder - shoulders) + 0.06 * length * high.up);
  }
}

void complete_hand(BodyJoints& joints, const std::string& side) {
  if (has_fingers(joints, side)) {
    add_missing(joints, side + "hand", joints.at(finger_point(side, kFingers[2], 1)));
    add_missing(joints, side + "fingertip", joints.at(finger_point(side, kFingers[2], kFingerPoints)));
  }
  const Vector3d forearm = joints.at(side + "wrist") - joints.at(side + "elbow");
  const double length = forearm.norm();
  const bool has_hand = joints.has(side + "hand");
  const Vector3d along =
      has_hand ? (joints.at(side + "hand") - joints.at(side + "wrist")).normalized() : Vector3d(forearm / length);
  add_missing(joints, side + "hand", joints.at(side + "wrist") + 0.36 * length * along);
  add_missing(joints, side + "fingertip", joints.at(side + "hand") + 0.36 * length * along);
}

/// The toes lie in the direction of the foot, at the height of the ball of the foot.
void complete_foot(BodyJoints& joints, const std::string& side) {
  const Vector3d& ankle = joints.at(side + "ankle");
  const Vector3d shin = ankle - joints.at(side + "knee");
  const double length = shin.norm();
  const Vector3d down = shin / length, ahead = pelvis_frame(joints).forward;
  const Vector3d forward = (ahead - ahead.dot(down) * down).normalized();
  add_missing(joints, side + "toe", ankle + length * (0.31 * forward + 0.12 * down));
  const Vector3d foot = joints.at(side + "toe") - ankle;
  const Vector3d level = (foot - foot.dot(down) * down).normalized();
  add_missing(joints, side + "toe_end", joints.at(side + "toe") + 0.17 * length * level);
  add_missing(joints, side + "heel", ankle + length * (0.13 * down - 0.10 * level));
}

/// A length that two joints must keep, as a share of the trunk (middle of the hips to middle of the shoulders).
struct LengthRange {
  const char *from, *to;
  double least, most;
};
constexpr std::array<LengthRange, 6> kLengths{{{"shoulder", "elbow", 0.3, 1.1},
                                               {"elbow", "wrist", 0.25, 1.0},
                                               {"hip", "knee", 0.4, 1.5},
                                               {"knee", "ankle", 0.4, 1.5},
                                               {"ankle", "toe", 0.05, 0.7},
                                               {"clavicle", "shoulder", 0.05, 0.6}}};
constexpr double kMaxAsymmetry = 1.35;

void examine_lengths(const BodyJoints& joints, double trunk, std::vector<std::string>& faults) {
  for (const LengthRange& range : kLengths) {
    std::array<double, 2> length{};
    bool known = true;
    for (const int side : {0, 1}) {
      const std::string prefix = side == 0 ? "left_" : "right_";
      if (!joints.has(prefix + range.from) || !joints.has(prefix + range.to)) {
        known = false;
        continue;
      }
      const double l = (joints.at(prefix + range.from) - joints.at(prefix + range.to)).norm();
      length[side] = l;
      if (l < range.least * trunk || l > range.most * trunk)
        faults.push_back(fmt::format("{0}{1} to {0}{2} is {3:.3f} m, {4:.2f} times the trunk; allowed is {5} to {6}",
                                     prefix, range.from, range.to, l, l / trunk, range.least, range.most));
    }
    if (known && std::max(length[0], length[1]) > kMaxAsymmetry * std::min(length[0], length[1]))
      faults.push_back(fmt::format("{} to {} is {:.3f} m on the left and {:.3f} m on the right", range.from, range.to,
                                   length[0], length[1]));
  }
}

/// Knees bend backwards and toes point forwards. If hips and feet disagree, left and right may be swapped.
void examine_sides(const BodyJoints& joints, std::vector<std::string>& faults) {
  const BodyFrame low = pelvis_frame(joints), high = chest_frame(joints);
  if (low.left.dot(high.left) < 0)
    faults.emplace_back("the shoulders face against the hips: left and right are swapped in one of the two");
  int backward = 0, known = 0;
  for (const std::string side : {"left_", "right_"}) {
    if (!joints.has(side + "toe")) continue;
    ++known;
    if ((joints.at(side + "toe") - joints.at(side + "ankle")).dot(low.forward) < 0) ++backward;
  }
  if (known == 2 && backward == 2) faults.emplace_back("both feet point backwards: left and right are swapped");
  for (const auto& [near, far] :
       {std::pair{"shoulder", "elbow"}, std::pair{"hip", "knee"}, std::pair{"knee", "ankle"}}) {
    const std::string a = std::string("left_") + near, b = std::string("left_") + far, c = other_side(a),
                      d = other_side(b);
    const double straight = (joints.at(a) - joints.at(b)).norm() + (joints.at(c) - joints.at(d)).norm();
    const double crossed = (joints.at(a) - joints.at(d)).norm() + (joints.at(c) - joints.at(b)).norm();
    if (crossed < 0.9 * straight)
      faults.push_back(
          fmt::format("left and right {} are swapped: each lies nearer to the other side's {}", far, near));
  }
}

void examine_order(const BodyJoints& joints, std::vector<std::string>& faults) {
  const Vector3d up = chest_frame(joints).up;
  const std::vector<std::string> chain{"pelvis", "spine", "chest", "neck", "head"};
  for (std::size_t i = 0; i + 1 < chain.size(); ++i)
    if (joints.has(chain[i]) && joints.has(chain[i + 1]) &&
        (joints.at(chain[i + 1]) - joints.at(chain[i])).dot(up) <= 0)
      faults.push_back(fmt::format("{} lies below {}", chain[i + 1], chain[i]));
}

}  // namespace

const Eigen::Vector3d& BodyJoints::at(const std::string& name) const {
  const auto found = positions.find(name);
  if (found == positions.end()) fail("the joints of a body: '{}' is missing", name);
  return found->second;
}

const std::vector<std::string>& body_joint_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all{"pelvis", "spine", "chest", "neck", "head"};
    const auto sided = both_sides({"clavicle", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe"});
    all.insert(all.end(), sided.begin(), sided.end());
    return all;
  }();
  return names;
}

const std::vector<std::string>& limb_joint_names() {
  static const auto names = both_sides({"shoulder", "elbow", "wrist", "hip", "knee", "ankle"});
  return names;
}

const std::vector<std::string>& extra_point_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all{"head_top", "nose"};
    const auto sided = both_sides({"eye", "ear", "hand", "fingertip", "toe_end", "heel"});
    all.insert(all.end(), sided.begin(), sided.end());
    for (const char* side : {"left_", "right_"})
      for (const Finger& finger : kFingers)
        for (int k = 1; k <= kFingerPoints; ++k) all.push_back(finger_point(side, finger, k));
    return all;
  }();
  return names;
}

std::string finger_point(const std::string& side, const Finger& finger, int k) {
  return side + finger.point + std::to_string(k);
}

bool has_fingers(const BodyJoints& joints, const std::string& side) {
  for (const Finger& finger : kFingers)
    for (int k = 1; k <= kFingerPoints; ++k)
      if (!joints.has(finger_point(side, finger, k))) return false;
  return true;
}

std::string other_side(const std::string& name) {
  if (name.starts_with("left_")) return "right_" + name.substr(5);
  if (name.starts_with("right_")) return "left_" + name.substr(6);
  return name;
}

BodyFrame pelvis_frame(const BodyJoints& joints) {
  return frame_of(joints.at("left_hip") - joints.at("right_hip"), middle(joints, "shoulder") - middle(joints, "hip"));
}

BodyFrame chest_frame(const BodyJoints& joints) {
  return frame_of(joints.at("left_shoulder") - joints.at("right_shoulder"),
                  middle(joints, "shoulder") - middle(joints, "hip"));
}

void complete_joints(BodyJoints& joints) {
  for (const std::string& name : limb_joint_names()) joints.at(name);
  complete_trunk(joints);
  for (const std::string side : {"left_", "right_"}) {
    complete_hand(joints, side);
    complete_foot(joints, side);
  }
}

std::vector<std::string> examine_joints(const BodyJoints& joints) {
  std::vector<std::string> faults;
  for (const std::string& name : limb_joint_names())
    if (!joints.has(name)) faults.push_back(fmt::format("{} is missing", name));
  for (const auto& [name, position] : joints.positions)
    if (!position.allFinite()) faults.push_back(fmt::format("{} has no finite position", name));
  if (!faults.empty()) return faults;
  const double trunk = (middle(joints, "shoulder") - middle(joints, "hip")).norm();
  if (!(trunk > 0.05)) {
    faults.push_back(fmt::format("shoulders and hips are {:.3f} m apart", trunk));
    return faults;
  }
  try {
    examine_lengths(joints, trunk, faults);
    examine_sides(joints, faults);
    examine_order(joints, faults);
  } catch (const Error& error) {
    faults.emplace_back(error.what());
  }
  return faults;
}

}  // namespace doppel
