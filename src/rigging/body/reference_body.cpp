#include "doppel/rigging/body/reference_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/geometry/isosurface.h"
#include "doppel/geometry/unwrap.h"
#include "doppel/rigging/body/body_warp.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/make_character.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

double mean_of(const char* name) {
  static const std::vector<double> kMeans = mean_measures();
  return kMeans[measure_index(name)];
}

Vector3d other_half(const Vector3d& p) { return {-p.x(), p.y(), p.z()}; }

void add_pair(BodyJoints& joints, const std::string& part, const Vector3d& left) {
  joints.positions["left_" + part] = left;
  joints.positions["right_" + part] = other_half(left);
}

/// From the ground to the hips. @return the middle of the hips
Vector3d add_legs(BodyJoints& joints) {
  const Vector3d thigh = mean_of("thigh_length") * Vector3d(0.13, -1, 0.015).normalized();
  const Vector3d shin = mean_of("shin_length") * Vector3d(0.10, -1, -0.045).normalized();
  const double x = 0.5 * mean_of("hip_breadth"), foot = mean_of("foot_length");
  const Vector3d hip(x, mean_of("ankle_height") - thigh.y() - shin.y(), 0);
  const Vector3d ankle = hip + thigh + shin, forward = Vector3d(0.12, 0, 1).normalized();
  const auto on_foot = [&](double share, double height) {
    Vector3d p = ankle + share * foot * forward;
    p.y() = height;
    return p;
  };
  add_pair(joints, "hip", hip);
  add_pair(joints, "knee", hip + thigh);
  add_pair(joints, "ankle", ankle);
  add_pair(joints, "heel", on_foot(-0.235, 0.03));
  add_pair(joints, "toe", on_foot(0.47, 0.025));
  add_pair(joints, "toe_end", on_foot(0.765, 0.02));
  return {0, hip.y(), 0};
}

/// The axes of a hand, palm down: along it, towards the thumb, towards the palm.
Eigen::Matrix3d hand_axes(const Vector3d& forearm) {
  const Vector3d palm = forearm.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << forearm, palm.cross(forearm), palm;
  return axes;
}

/// Fingers of an open hand, apart from each other and a little bent. Positions are shares of the length of the hand.
void add_fingers(BodyJoints& joints, const Vector3d& wrist, const Vector3d& forearm) {
  const std::array<Vector3d, 4> thumb{
      {{0.14, 0.13, 0.03}, {0.35, 0.26, 0.07}, {0.51, 0.335, 0.08}, {0.645, 0.375, 0.08}}};
  const std::array<std::array<Vector3d, 2>, 4> knuckle_and_tip{{{{{0.455, 0.15, -0.01}, {0.92, 0.225, 0.04}}},
                                                                {{{0.47, 0.045, -0.01}, {1.0, 0.055, 0.045}}},
                                                                {{{0.445, -0.06, -0.005}, {0.94, -0.10, 0.045}}},
                                                                {{{0.405, -0.155, 0.0}, {0.80, -0.255, 0.04}}}}};
  constexpr std::array<double, 4> kJoint{0.0, 0.45, 0.75, 1.0}, kBend{0.0, 0.2, 0.56, 1.0};
  const Eigen::Matrix3d axes = mean_of("hand_length") * hand_axes(forearm);
  for (std::size_t f = 0; f < kFingers.size(); ++f)
    for (std::size_t k = 0; k < kFingerPoints; ++k) {
      Vector3d at = thumb[k];
      if (f > 0) {
        const auto& [knuckle, tip] = knuckle_and_tip[f - 1];
        at = knuckle + kJoint[k] * (tip - knuckle);
        at.z() = knuckle.z() + kBend[k] * (tip.z() - knuckle.z());
      }
      add_pair(joints, finger_point("", kFingers[f], static_cast<int>(k) + 1), wrist + axes * at);
    }
}

void add_arms(BodyJoints& joints, const Vector3d& shoulder) {
  const Vector3d arm = Vector3d(0.74, -0.67, 0.0).normalized(), forearm = Vector3d(0.74, -0.66, 0.10).normalized();
  const Vector3d elbow = shoulder + mean_of("upper_arm_length") * arm;
  const Vector3d wrist = elbow + mean_of("forearm_length") * forearm;
  add_pair(joints, "shoulder", shoulder);
  add_pair(joints, "elbow", elbow);
  add_pair(joints, "wrist", wrist);
  add_pair(joints, "hand", wrist + 0.47 * mean_of("hand_length") * forearm);
  add_pair(joints, "fingertip", wrist + mean_of("hand_length") * forearm);
  add_fingers(joints, wrist, forearm);
}

constexpr double kHandReach = 0.25,
                 kHandMargin = 0.03;  ///< farther from the wrist, only a bound of the distance counts
constexpr double kSkullTop = 0.11;    ///< top of the skull above its middle, metres

/// The parts of the reference body. Lengths that are given as numbers are metres on a body of mean stature.
class ReferenceShape {
 public:
  ReferenceShape() : j_(reference_joints()) {
    hips_ = 0.5 * (j_.at("left_hip") + j_.at("right_hip"));
    trunk_ = j_.at("neck") - hips_;
    neck_ = j_.at("neck"), head_ = j_.at("head"), skull_ = j_.at("head_top") - kSkullTop * Vector3d::UnitY();
    shoulder_ = j_.at("left_shoulder"), elbow_ = j_.at("left_elbow"), wrist_ = j_.at("left_wrist");
    hip_ = j_.at("left_hip"), knee_ = j_.at("left_knee"), ankle_ = j_.at("left_ankle");
    forearm_ = (wrist_ - elbow_).normalized();
    hand_ = hand_axes(forearm_);
    for (std::size_t f = 0; f < kFingers.size(); ++f)
      for (std::size_t k = 0; k < kFingerPoints; ++k)
        fingers_[f][k] = j_.at(finger_point("left_", kFingers[f], static_cast<int>(k) + 1));
    forward_ = j_.at("left_toe_end") - j_.at("left_heel");
    forward_.y() = 0;
    forward_.normalize();
    outward_ = Vector3d::UnitY().cross(forward_);
  }

  double distance(const Vector3d& p) const {
    const Vector3d q(std::abs(p.x()), p.y(), p.z());
    double d = smooth_min(torso(q), neck(q), 0.04);
    d = smooth_min(d, head(q), 0.03);
    const double legs = smooth_min(leg(p), leg(other_half(p)), 0.012);
    d = smooth_min(d, legs, 0.06);
    return smooth_min(d, arm(q), 0.07);
  }

 private:
  Vector3d on_trunk(double t, double side, double front) const { return hips_ + t * trunk_ + Vector3d(side, 0, front); }

  double torso(const Vector3d& q) const {
    double d = ellipsoid(q, on_trunk(0.60, 0, 0.004), {0.172, 0.22, 0.117});
    d = smooth_min(d, ellipsoid(q, on_trunk(0.30, 0, 0.012), {0.153, 0.22, 0.103}), 0.08);
    d = smooth_min(d, ellipsoid(q, on_trunk(0.15, 0, 0), {0.156, 0.12, 0.102}), 0.06);
    d = smooth_min(d, ellipsoid(q, on_trunk(0.05, 0, -0.002), {0.175, 0.105, 0.106}), 0.06);
    d = smooth_min(d, round_cone(q, on_trunk(0.88, 0.03, -0.005), shoulder_ + Vector3d(-0.01, 0.004, 0), 0.058, 0.052),
                   0.07);
    d = smooth_min(d, ellipsoid(q, on_trunk(0.645, 0.072, 0.070), {0.068, 0.062, 0.046}), 0.06);
    return smooth_min(d, ellipsoid(q, on_trunk(0, 0.070, -0.056), {0.082, 0.076, 0.062}), 0.05);
  }

  double neck(const Vector3d& q) const {
    const double d = round_cone(q, neck_ - Vector3d(0, 0.03, 0), head_ + Vector3d(0, 0.02, 0.005), 0.051, 0.048);
    const double shoulders = round_cone(q, on_trunk(0.955, 0.02, -0.014), on_trunk(0.905, 0.115, -0.010), 0.040, 0.036);
    return smooth_min(d, shoulders, 0.05);
  }

  double head(const Vector3d& p) const {
    const Vector3d q = p - skull_;
    double d = ellipsoid(q, Vector3d::Zero(), {0.0753, kSkullTop, 0.097});
    d = smooth_min(d, ellipsoid(q, {0, -0.055, 0.028}, {0.053, 0.062, 0.060}), 0.04);
    d = smooth_min(d, round_cone(q, {0, 0.006, 0.090}, {0, -0.027, 0.108}, 0.009, 0.0135), 0.018);
    return smooth_min(d, ellipsoid(q, {0.079, -0.012, -0.012}, {0.011, 0.030, 0.018}), 0.012);
  }

  /// A finger: from joint to joint, thinner towards the tip. @param points of the finger on the left
  static double finger(const Vector3d& q, const std::array<Vector3d, kFingerPoints>& points, double knuckle,
                       double tip) {
    const double middle = 0.5 * (knuckle + tip);
    const Vector3d end = points[3] - tip * (points[3] - points[2]).normalized();
    return std::min({round_cone(q, points[0], points[1], knuckle, middle),
                     round_cone(q, points[1], points[2], middle, tip), round_cone(q, points[2], end, tip, tip)});
  }

  double hand(const Vector3d& q) const {
    if ((q - wrist_).squaredNorm() > kHandReach * kHandReach) return (q - wrist_).norm() - kHandReach + kHandMargin;
    const Vector3d local = hand_.transpose() * (q - wrist_);
    double d = ellipsoid(local, {0.047, 0.001, 0.002}, {0.060, 0.039, 0.0165});
    for (std::size_t f = 1; f < kFingers.size(); ++f) {
      const Vector3d& knuckle = fingers_[f][0];
      d = smooth_min(d, round_cone(q, wrist_ + 0.25 * (knuckle - wrist_), knuckle, 0.013, 0.0115), 0.012);
    }
    const Vector3d& thumb = fingers_[0][1];
    d = smooth_min(d, round_cone(q, wrist_ + 0.25 * (thumb - wrist_), thumb, 0.016, 0.0125), 0.016);
    d = smooth_min(d, finger(q, fingers_[0], 0.0125, 0.0085), 0.006);
    double fingers = std::numeric_limits<double>::infinity();
    for (std::size_t f = 1; f < kFingers.size(); ++f)
      fingers = std::min(fingers, finger(q, fingers_[f], f == 4 ? 0.0085 : 0.0098, f == 4 ? 0.006 : 0.007));
    return smooth_min(d, fingers, 0.006);
  }

  double arm(const Vector3d& q) const {
    double d = round_cone(q, shoulder_, elbow_, 0.056, 0.046);
    d = smooth_min(d, ellipsoid(q, shoulder_ + Vector3d(0.008, 0, 0), {0.054, 0.052, 0.054}), 0.04);
    const Vector3d belly = elbow_ + 0.25 * (wrist_ - elbow_);
    double forearm = round_cone(q, elbow_, wrist_, 0.042, 0.0255);
    forearm = smooth_min(forearm, round_cone(q, belly, belly + 0.06 * forearm_, 0.044, 0.038), 0.03);
    return smooth_min(smooth_min(d, forearm, 0.025), hand(q), 0.02);
  }

  double foot(const Vector3d& p) const {
    const Vector3d q = p - ankle_, local(q.dot(outward_), p.y(), q.dot(forward_));
    double d = round_cone(local, {0.0, 0.042, -0.018}, {0.004, 0.036, 0.125}, 0.041, 0.043);
    d = smooth_min(d, ellipsoid(local, {0.004, 0.028, 0.150}, {0.047, 0.032, 0.060}), 0.03);
    d = smooth_min(d, round_cone(local, {0, ankle_.y() + 0.005, 0}, {0, ankle_.y() + 0.05, -0.002}, 0.037, 0.032),
                   0.03);
    return smooth_max(d, -p.y(), 0.012);
  }

  double leg(const Vector3d& p) const {
    // Deeper than wide: two cones, one in front of the other.
    const Vector3d thigh = hip_ + 0.30 * (knee_ - hip_) + Vector3d(0.006, 0, 0), deep(0, 0, 0.014);
    const auto upper = [&](const Vector3d& aside) {
      return smooth_min(round_cone(p, hip_ + aside, thigh + aside, 0.080, 0.080),
                        round_cone(p, thigh + aside, knee_ + 0.3 * aside, 0.080, 0.051), 0.04);
    };
    double d = smooth_min(upper(deep), upper(-deep), 0.03);
    const Vector3d shin = ankle_ - knee_;
    double lower = round_cone(p, knee_, ankle_, 0.051, 0.032);
    lower = smooth_min(lower, ellipsoid(p, knee_ + 0.27 * shin - Vector3d(0, 0, 0.014), {0.056, 0.125, 0.058}), 0.04);
    d = smooth_min(d, lower, 0.06);
    return smooth_min(d, foot(p), 0.02);
  }

  BodyJoints j_;
  Vector3d hips_, trunk_, neck_, head_, skull_, shoulder_, elbow_, wrist_, hip_, knee_, ankle_;
  Vector3d forearm_, forward_, outward_;
  Eigen::Matrix3d hand_;
  std::array<std::array<Vector3d, kFingerPoints>, kFingers.size()> fingers_;  ///< of the left hand
};

/// Edges are shorter where the shape has fine detail: face, head, hands, feet.
double relative_edge_at(const Vector3d& p, const BodyJoints& joints) {
  const double wrist = joints.at("left_wrist").x(), knuckles = joints.at("left_hand").x();
  if (std::abs(p.x()) > wrist + 0.75 * (knuckles - wrist)) return 0.32;
  if (p.y() > joints.at("head").y() - 0.06) return p.z() > 0.02 ? 0.5 : 0.7;
  if (std::abs(p.x()) > wrist - 0.03) return 0.55;
  return p.y() < 0.1 ? 0.75 : 1.0;
}

/// The grid that the body is meshed with: finer where the fingers are, to tell them apart.
GridLines body_lines(const BodyJoints& joints) {
  constexpr double kCell = 0.009, kFingerCell = 0.0045, kMargin = 0.015;  // metres
  const Vector3d low(-0.80, -0.05, -0.30), high(0.80, 1.78, 0.35);
  GridLines lines = regular_lines(low, high, kCell);
  for (const std::string side : {"left_", "right_"}) {
    Eigen::AlignedBox3d fingers;
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k) fingers.extend(joints.at(finger_point(side, finger, k)));
    refine_lines(lines, fingers.min().array() - kMargin, fingers.max().array() + kMargin, kFingerCell);
  }
  return lines;
}

}  // namespace

BodyJoints reference_joints() {
  BodyJoints joints;
  const Vector3d hips = add_legs(joints);
  const Vector3d trunk = mean_of("trunk_length") * Vector3d(0, 1, -0.03).normalized();
  const auto on_trunk = [&](double t, double side, double front) {
    return Vector3d(hips + t * trunk + Vector3d(side, 0, front));
  };
  joints.positions["pelvis"] = on_trunk(0.08, 0, 0);
  joints.positions["spine"] = on_trunk(0.27, 0, -0.01);
  joints.positions["chest"] = on_trunk(0.60, 0, -0.02);
  const Vector3d neck = on_trunk(1, 0, 0);
  const Vector3d head = neck + mean_of("neck_length") * Vector3d(0, 1, 0.16).normalized();
  const Vector3d top = head + mean_of("head_height") * Vector3d(0, 1, 0.04).normalized();
  const Vector3d skull = top - kSkullTop * Vector3d::UnitY();
  joints.positions["neck"] = neck;
  joints.positions["head"] = head;
  joints.positions["head_top"] = top;
  joints.positions["nose"] = skull + Vector3d(0, -0.027, 0.121);
  add_pair(joints, "eye", skull + Vector3d(0.031, 0.004, 0.084));
  add_pair(joints, "ear", skull + Vector3d(0.084, -0.012, -0.010));
  add_pair(joints, "clavicle", on_trunk(0.89, 0.033, 0.005));
  add_arms(joints, on_trunk(kShoulderLevel, 0.5 * mean_of("shoulder_breadth"), 0));
  return joints;
}

DistanceField reference_field() {
  return [shape = ReferenceShape()](const Vector3d& p) { return shape.distance(p); };
}

ReferenceBody make_reference_body(int num_vertices, int num_nodes) {
  constexpr double kSolidCell = 0.012, kGutter = 3.0 / 1024;  // metres, metres, of the texture
  const DistanceField field = reference_field();
  ReferenceBody body;
  body.joints = reference_joints();
  const GridLines lines = body_lines(body.joints);
  const TriangleMesh fine = mesh_field(field, lines);
  TriangleMesh mesh =
      coarsen(fine, field, num_vertices, [&](const Vector3d& p) { return relative_edge_at(p, body.joints); });
  unwrap(mesh, kGutter);
  CharacterOptions options;
  options.num_nodes = num_nodes;
  VoxelSolidOptions solid;
  solid.cell = kSolidCell;
  body.character = make_character("body", mesh, body.joints, solid_grid(VoxelSolid(mesh, solid)), options);
  return body;
}

}  // namespace doppel
