#include "doppel/rigging/joints/body_skeleton.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/rigging/joints/fingers.h"

namespace doppel {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d turn(double angle, const Vector3d& axis) { return AngleAxisd(angle, axis).toRotationMatrix(); }

/// 0 below `low`, 1 above `high`.
double smooth_share(double low, double high, double value) {
  const double t = std::clamp((value - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// The difference of two angles, -pi..pi.
double wrapped(double angle) { return std::remainder(angle, 2 * M_PI); }

/// Collects joints with their rest positions. The rotations of the rest pose turn the offsets back to the zero pose.
class RestSkeleton {
 public:
  /// A joint without motion. @param position in the rest pose, metres
  int fixed(const std::string& name, int parent, const Vector3d& position) {
    return add(name, parent, position, Vector3d::UnitX(), Joint::Type::revolute, 0.0);
  }

  /// A joint and a DoF of the same name.
  int turning(const std::string& name, int parent, const Vector3d& position, const Vector3d& axis, double rest,
              double low, double high) {
    const int j = add(name, parent, position, axis, Joint::Type::revolute, rest);
    dof(name, {{j, 1.0}}, rest, low, high);
    return j;
  }

  /// A joint that turns with a share of a DoF that is added later.
  int sharing(const std::string& name, int parent, const Vector3d& position, const Vector3d& axis, double angle) {
    return add(name, parent, position, axis, Joint::Type::revolute, angle);
  }

  int root(const std::string& name, int parent, const Vector3d& axis, bool translation, double rest) {
    // A joint translation is in millimetres; the weight makes the unit of the DoF metres.
    const int j = add(name, parent, rest_position_, translation ? Vector3d(0.001 * axis) : axis,
                      translation ? Joint::Type::prismatic : Joint::Type::revolute, translation ? 0.0 : rest);
    body.skeleton.joints.back().offset.setZero();
    body.skeleton.dofs.push_back({name, {{j, translation ? 1000.0 : 1.0}}, std::nullopt});
    body.rest_dofs.push_back(rest);
    return j;
  }
  void begin(const Vector3d& root_position) { rest_position_ = root_position; }

  void dof(const std::string& name, const std::vector<Dof::Drive>& drives, double rest, double low, double high) {
    constexpr double kMargin = 0.05;
    const std::array<double, 2> limits{std::min(low, rest - kMargin), std::max(high, rest + kMargin)};
    body.skeleton.dofs.push_back({name, drives, limits});
    body.rest_dofs.push_back(rest);
  }

  /// World rotation of a joint's frame in the rest pose.
  const Matrix3d& rotation(int joint) const { return rotations_[joint]; }

  BodySkeleton body;

 private:
  int add(const std::string& name, int parent, const Vector3d& position, const Vector3d& axis, Joint::Type type,
          double angle) {
    const Matrix3d above = parent < 0 ? Matrix3d::Identity() : rotations_[parent];
    const Vector3d offset =
        parent < 0 ? Vector3d::Zero() : Vector3d(above.transpose() * (position - positions_[parent]));
    body.skeleton.joints.push_back({name, type, parent, offset, axis});
    positions_.push_back(position);
    rotations_.push_back(type == Joint::Type::revolute ? Matrix3d(above * turn(angle, axis)) : above);
    return body.skeleton.num_joints() - 1;
  }

  Vector3d rest_position_;
  std::vector<Vector3d> positions_;
  std::vector<Matrix3d> rotations_;
};

Matrix3d matrix_of(const BodyFrame& frame) {
  Matrix3d m;
  m << frame.left, frame.up, frame.forward;
  return m;
}

int add_root(RestSkeleton& b, const BodyJoints& joints) {
  const Vector3d& pelvis = joints.at("pelvis");
  const Matrix3d r = matrix_of(pelvis_frame(joints));
  const double rz = std::asin(std::clamp(r(1, 0), -1.0, 1.0)), ry = std::atan2(-r(2, 0), r(0, 0));
  const Matrix3d rest = (turn(ry, Vector3d::UnitY()) * turn(rz, Vector3d::UnitZ())).transpose() * r;
  b.begin(pelvis);
  int j = b.root("Root_tx", -1, Vector3d::UnitX(), true, pelvis.x());
  j = b.root("Root_ty", j, Vector3d::UnitY(), true, pelvis.y());
  j = b.root("Root_tz", j, Vector3d::UnitZ(), true, pelvis.z());
  j = b.root("Root_ry", j, Vector3d::UnitY(), false, ry);
  j = b.root("Root_rz", j, Vector3d::UnitZ(), false, rz);
  return b.root("Root_rx", j, Vector3d::UnitX(), false, std::atan2(rest(2, 1), rest(1, 1)));
}

/// A joint of the spine or the neck and its share of their DoFs.
struct Link {
  std::string name;
  Vector3d position;
  double share;
};
struct SharedAxis {
  const char* suffix;
  Vector3d axis;
  double rest, low, high;
};

/// A chain whose joints share three DoFs, which are named after `dof_bone`.
int add_links(RestSkeleton& b, int parent, const std::vector<Link>& links, const std::vector<SharedAxis>& axes,
              const std::string& dof_bone) {
  std::vector<std::vector<Dof::Drive>> drives(axes.size());
  for (const Link& link : links)
    for (std::size_t i = 0; i < axes.size(); ++i) {
      parent = b.sharing(link.name + axes[i].suffix, parent, link.position, axes[i].axis, link.share * axes[i].rest);
      drives[i].push_back({parent, link.share});
    }
  for (std::size_t i = 0; i < axes.size(); ++i)
    b.dof(dof_bone + axes[i].suffix, drives[i], axes[i].rest, axes[i].low, axes[i].high);
  return parent;
}

int add_spine(RestSkeleton& b, int root, const BodyJoints& joints) {
  const Matrix3d r = b.rotation(root).transpose() * matrix_of(chest_frame(joints));
  const double rz = -std::asin(std::clamp(r(0, 1), -1.0, 1.0)), rx = std::atan2(r(2, 1), r(1, 1));
  const Matrix3d rest = (turn(rx, Vector3d::UnitX()) * turn(rz, Vector3d::UnitZ())).transpose() * r;
  const double ry = std::atan2(rest(0, 2), rest(0, 0));
  const Vector3d &spine = joints.at("spine"), &chest = joints.at("chest");
  return add_links(b, root, {{"Spine", spine, 0.35}, {"Spine1", 0.5 * (spine + chest), 0.35}, {"Chest", chest, 0.3}},
                   {{"_rx", Vector3d::UnitX(), rx, -0.6, 1.4},
                    {"_rz", Vector3d::UnitZ(), rz, -0.7, 0.7},
                    {"_ry", Vector3d::UnitY(), ry, -0.9, 0.9}},
                   "Spine");
}

void add_head(RestSkeleton& b, int chest, const BodyJoints& joints) {
  const int head = add_links(b, chest, {{"Neck", joints.at("neck"), 0.5}, {"Head", joints.at("head"), 0.5}},
                             {{"_ry", Vector3d::UnitY(), 0, -1.4, 1.4},
                              {"_rz", Vector3d::UnitZ(), 0, -0.8, 0.8},
                              {"_rx", Vector3d::UnitX(), 0, -1.1, 1.0}},
                             "Head");
  b.fixed("HeadEE", head, joints.at("head_top"));
}

/// The angles of a limb in its rest pose: two that point the upper bone, its twist, and the bend of the lower bone.
struct LimbAngles {
  double first = 0, second = 0, twist = 0, bend = 0;
};

/// @param upper, lower directions in the frame of the chest, unit; @param s 1 on the left, -1 on the right
LimbAngles arm_angles(const Vector3d& upper, const Vector3d& lower, double s) {
  LimbAngles a;
  a.second = std::asin(std::clamp(upper.z(), -1.0, 1.0));
  a.first = std::hypot(upper.x(), upper.y()) < 0.02 ? 0.0 : std::atan2(upper.y(), s * upper.x());
  if (a.first < -2.2 || a.first > 2.8) {  // across the body: the same direction, turned forward beyond 90 degrees
    a.first += a.first < 0 ? M_PI : -M_PI;
    a.second = M_PI - a.second;
  }
  const Vector3d f =
      (turn(s * a.first, Vector3d::UnitZ()) * turn(-s * a.second, Vector3d::UnitY())).transpose() * lower;
  const double bend = std::atan2(std::hypot(f.y(), f.z()), s * f.x());
  // A straight arm does not tell its twist; then the elbow bends forwards, as in the zero pose.
  a.twist = smooth_share(0.12, 0.35, bend) * std::atan2(f.y(), f.z());
  a.bend = std::atan2(f.y() * std::sin(a.twist) + f.z() * std::cos(a.twist), s * f.x());
  return a;
}

/// @param foot from ankle to toe
LimbAngles leg_angles(const Vector3d& upper, const Vector3d& lower, const Vector3d& foot, double s) {
  LimbAngles a;
  a.second = std::asin(std::clamp(s * upper.x(), -1.0, 1.0));
  a.first = std::atan2(upper.z(), -upper.y());
  const Matrix3d pointed = turn(-a.first, Vector3d::UnitX()) * turn(s * a.second, Vector3d::UnitZ());
  const Vector3d f = pointed.transpose() * lower, g = pointed.transpose() * foot;
  const double bend = std::atan2(std::hypot(f.x(), f.z()), -f.y());
  // The knee bends in the direction of the foot. A bent knee shows the direction better than the foot.
  const double of_foot = std::clamp(std::atan2(g.x(), g.z()), -0.8, 0.8), of_knee = std::atan2(-f.x(), -f.z());
  const double turned = of_foot + smooth_share(0.3, 0.7, bend) * wrapped(of_knee - of_foot);
  a.twist = s * turned;
  a.bend = std::atan2(-(f.x() * std::sin(turned) + f.z() * std::cos(turned)), -f.y());
  return a;
}

/// The axes about which the fingers of a hand turn towards the thumb, and bend to the palm.
Vector3d spread_axis(const std::string& side) { return (side == "left_" ? -1.0 : 1.0) * Vector3d::UnitY(); }
Vector3d bend_axis(const std::string& side) { return (side == "left_" ? -1.0 : 1.0) * Vector3d::UnitZ(); }

/// The first joint of a finger: it turns towards the thumb and to the palm. @param spread, bend limits
int add_knuckle(RestSkeleton& b, int hand, const BodyJoints& joints, const std::string& side, const Finger& finger,
                const std::array<double, 2>& spread, const std::array<double, 2>& bend) {
  const Vector3d& knuckle = joints.at(finger_point(side, finger, 1));
  const std::string bone = finger_bone(side, finger, 1);
  const int j = b.turning(bone + "_ry", hand, knuckle, spread_axis(side), 0, spread[0], spread[1]);
  return b.turning(bone + "_rz", j, knuckle, bend_axis(side), 0, bend[0], bend[1]);
}

/// A finger that spreads and bends at its knuckle; its two last joints bend together, as their tendon couples them.
void add_finger(RestSkeleton& b, int hand, const BodyJoints& joints, const std::string& side, const Finger& finger) {
  constexpr double kLastJoint = 0.67;  // its share of the bend of the joint before
  const Vector3d palmwards = bend_axis(side);
  const auto bone = [&](int k) { return finger_bone(side, finger, k); };
  const auto point = [&](int k) { return joints.at(finger_point(side, finger, k)); };
  const int j = add_knuckle(b, hand, joints, side, finger, {-0.35, 0.35}, {-0.5, 1.6});
  const int middle = b.sharing(bone(2) + "_rz", j, point(2), palmwards, 0);
  const int last = b.sharing(bone(3) + "_rz", middle, point(3), palmwards, 0);
  b.dof(bone(2) + "_rz", {{middle, 1.0}, {last, kLastJoint}}, 0, -0.1, 1.9);
  b.fixed(bone(3) + "EE", last, point(4));
}

/// A thumb: it moves away from the palm in two directions at the wrist, and its two other joints bend across the palm.
void add_thumb(RestSkeleton& b, int hand, const BodyJoints& joints, const std::string& side) {
  const Finger& thumb = kFingers[0];
  const auto bone = [&](int k) { return finger_bone(side, thumb, k); };
  const auto point = [&](int k) { return joints.at(finger_point(side, thumb, k)); };
  int j = add_knuckle(b, hand, joints, side, thumb, {-0.6, 0.5}, {-0.5, 0.9});
  // The tip moves towards the little finger and the palm alike.
  const Vector3d along = b.rotation(j).transpose() * (point(4) - point(2)).normalized();
  const Vector3d across = along.cross(Vector3d(0, -1, -1)).normalized();
  j = b.turning(bone(2) + "_rx", j, point(2), across, 0, -0.3, 1.0);
  j = b.turning(bone(3) + "_rx", j, point(3), across, 0, -0.3, 1.3);
  b.fixed(bone(3) + "EE", j, point(4));
}

/// How far the forearm of a hand with fingers is rolled in the scan. In the zero pose the palm faces down, and the
/// knuckles lie in a row from behind (little finger) to the front. Small angles may be errors of the knuckles.
/// @param hand_from_world rotation of the arm's frame before the roll @param forearm unit, in this frame
double forearm_roll(const Matrix3d& hand_from_world, const Vector3d& forearm, const BodyJoints& joints,
                    const std::string& side) {
  const auto across = [&](const Vector3d& v) { return Vector3d(v - v.dot(forearm) * forearm); };
  const Vector3d knuckles = across(hand_from_world * (joints.at(finger_point(side, kFingers.at(1), 1)) -
                                                      joints.at(finger_point(side, kFingers.back(), 1)))),
                 level = across(Vector3d::UnitZ());
  const Vector3d axis = (side == "left_" ? -1.0 : 1.0) * forearm;
  const double angle = std::atan2(level.cross(knuckles).dot(axis), level.dot(knuckles));
  return smooth_share(0.1, 0.3, std::abs(angle)) * angle;
}

void add_arm(RestSkeleton& b, int chest, const BodyJoints& joints, bool left) {
  const std::string bone = left ? "Left" : "Right", side = left ? "left_" : "right_";
  const double s = left ? 1 : -1;
  const Vector3d up = s * Vector3d::UnitZ(), ahead = -s * Vector3d::UnitY(), outward = -Vector3d::UnitX();
  const auto at = [&](const char* name) { return joints.at(side + name); };
  const Vector3d shoulder = at("shoulder"), elbow = at("elbow"), wrist = at("wrist");

  int j = b.turning(bone + "Shoulder_ry", chest, at("clavicle"), ahead, 0, -0.4, 0.5);
  j = b.turning(bone + "Shoulder_rz", j, at("clavicle"), up, 0, -0.2, 0.7);
  const Matrix3d chest_from_world = b.rotation(j).transpose();
  const LimbAngles a = arm_angles(chest_from_world * (elbow - shoulder).normalized(),
                                  chest_from_world * (wrist - elbow).normalized(), s);
  j = b.turning(bone + "Arm_rz", j, shoulder, up, a.first, -1.8, 1.7);
  j = b.turning(bone + "Arm_ry", j, shoulder, ahead, a.second, -0.9, 2.3);
  j = b.turning(bone + "Arm_rx", j, shoulder, outward, a.twist, -1.6, 1.8);
  j = b.turning(bone + "ForeArm_ry", j, elbow, ahead, a.bend, -0.1, 2.6);
  const Vector3d forearm = b.rotation(j).transpose() * (wrist - elbow).normalized();
  const double roll = has_fingers(joints, side) ? forearm_roll(b.rotation(j).transpose(), forearm, joints, side) : 0.0;
  j = b.turning(bone + "ForeArmRoll_rx", j, 0.5 * (elbow + wrist), -s * forearm, roll, -1.5, 1.6);
  j = b.turning(bone + "Hand_rz", j, wrist, up, 0, -1.3, 1.2);
  j = b.turning(bone + "Hand_ry", j, wrist, ahead, 0, -0.6, 0.5);
  b.fixed(bone + "HandEE", j, at("fingertip"));
  if (!has_fingers(joints, side)) return;
  add_thumb(b, j, joints, side);
  for (std::size_t f = 1; f < kFingers.size(); ++f) add_finger(b, j, joints, side, kFingers[f]);
}

void add_leg(RestSkeleton& b, int root, const BodyJoints& joints, bool left) {
  const std::string bone = left ? "Left" : "Right", side = left ? "left_" : "right_";
  const double s = left ? 1 : -1;
  const Vector3d ahead = -Vector3d::UnitX(), outward = s * Vector3d::UnitZ(), turned_out = s * Vector3d::UnitY();
  const auto at = [&](const char* name) { return joints.at(side + name); };
  const Vector3d hip = at("hip"), knee = at("knee"), ankle = at("ankle"), toe = at("toe");

  const Matrix3d pelvis_from_world = b.rotation(root).transpose();
  const LimbAngles a =
      leg_angles(pelvis_from_world * (knee - hip).normalized(), pelvis_from_world * (ankle - knee).normalized(),
                 pelvis_from_world * (toe - ankle).normalized(), s);
  int j = b.turning(bone + "UpLeg_rx", root, hip, ahead, a.first, -0.7, 2.3);
  j = b.turning(bone + "UpLeg_rz", j, hip, outward, a.second, -0.5, 1.1);
  j = b.turning(bone + "UpLeg_ry", j, hip, turned_out, a.twist, -0.8, 1.0);
  j = b.turning(bone + "Leg_rx", j, knee, Vector3d::UnitX(), a.bend, -0.1, 2.6);
  // In the zero pose the sole is level below an upright shin. The scan stands on its soles.
  const Vector3d sole_up = b.rotation(j).transpose() * Vector3d::UnitY();
  const bool upright = sole_up.y() > 0.8;
  const double rx = upright ? -std::atan2(sole_up.z(), sole_up.y()) : 0.0;
  const double rz = upright ? -s * std::asin(std::clamp(sole_up.x(), -1.0, 1.0)) : 0.0;
  j = b.turning(bone + "Foot_rx", j, ankle, ahead, rx, -1.0, 0.7);
  j = b.turning(bone + "Foot_rz", j, ankle, outward, rz, -0.5, 0.4);
  j = b.turning(bone + "ToeBase_rx", j, toe, ahead, 0, -0.5, 1.0);
  b.fixed(bone + "ToeBaseEE", j, at("toe_end"));
}

void check_length(const BodyJoints& joints, const std::string& from, const std::string& to) {
  if (!((joints.at(from) - joints.at(to)).norm() > 1e-4))
    fail("the skeleton of a body: {} and {} lie at one position; a bone needs a length", from, to);
}

void check_lengths(const BodyJoints& joints) {
  const std::vector<std::array<const char*, 2>> bones{
      {"shoulder", "elbow"}, {"elbow", "wrist"}, {"hip", "knee"}, {"knee", "ankle"}, {"ankle", "toe"}};
  for (const std::string side : {"left_", "right_"}) {
    for (const auto& [from, to] : bones) check_length(joints, side + from, side + to);
    if (!has_fingers(joints, side)) continue;
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerBones; ++k)
        check_length(joints, finger_point(side, finger, k), finger_point(side, finger, k + 1));
  }
}

}  // namespace

BodySkeleton make_body_skeleton(BodyJoints joints) {
  complete_joints(joints);
  check_lengths(joints);
  RestSkeleton b;
  const int root = add_root(b, joints);
  const int chest = add_spine(b, root, joints);
  add_head(b, chest, joints);
  for (const bool left : {true, false}) add_arm(b, chest, joints, left);
  for (const bool left : {true, false}) add_leg(b, root, joints, left);
  return b.body;
}

std::vector<HeatBone> heat_bones(BodyJoints joints) {
  complete_joints(joints);
  const auto at = [&](const std::string& name) { return joints.at(name); };
  const auto towards = [&](const std::string& from, const std::string& to, double share) {
    return Vector3d(at(from) + share * (at(to) - at(from)));
  };
  const double head = (at("head_top") - at("head")).norm();
  const Vector3d jaw = at("head") + head * (0.4 * chest_frame(joints).forward - 0.05 * chest_frame(joints).up);
  const Vector3d waist = 0.5 * (at("spine") + at("chest"));
  std::vector<HeatBone> bones{{"Root",
                               {{at("pelvis"), at("spine")},
                                {at("pelvis"), towards("pelvis", "left_hip", 0.6)},
                                {at("pelvis"), towards("pelvis", "right_hip", 0.6)}}},
                              {"Spine", {{at("spine"), waist}}},
                              {"Spine1", {{waist, at("chest")}}},
                              {"Chest",
                               {{at("chest"), towards("chest", "neck", 0.85)},
                                {at("chest"), towards("chest", "left_clavicle", 0.8)},
                                {at("chest"), towards("chest", "right_clavicle", 0.8)}}},
                              {"Neck", {{at("neck"), at("head")}}},
                              {"Head", {{at("head"), at("head_top")}, {at("head"), jaw}}}};
  for (const std::string side : {"left_", "right_"}) {
    const std::string bone = side == "left_" ? "Left" : "Right";
    const Vector3d forearm = towards(side + "elbow", side + "wrist", 0.5);
    bones.push_back(
        {bone + "Shoulder", {{at(side + "clavicle"), towards(side + "clavicle", side + "shoulder", 0.85)}}});
    bones.push_back({bone + "Arm", {{at(side + "shoulder"), at(side + "elbow")}}});
    bones.push_back({bone + "ForeArm", {{at(side + "elbow"), forearm}}});
    bones.push_back({bone + "ForeArmRoll", {{forearm, at(side + "wrist")}}});
    bones.push_back(
        {bone + "Hand", {{at(side + "wrist"), at(side + "hand")}, {at(side + "hand"), at(side + "fingertip")}}});
    bones.push_back({bone + "UpLeg", {{at(side + "hip"), at(side + "knee")}}});
    bones.push_back({bone + "Leg", {{at(side + "knee"), at(side + "ankle")}}});
    bones.push_back(
        {bone + "Foot",
         {{at(side + "ankle"), at(side + "toe")}, {at(side + "ankle"), towards(side + "ankle", side + "heel", 0.7)}}});
    bones.push_back({bone + "ToeBase", {{at(side + "toe"), at(side + "toe_end")}}});
  }
  return bones;
}

}  // namespace doppel
