#include "doppel/synth/other_body.h"

#include <Eigen/QR>
#include <charconv>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/rigging/body/body_warp.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/body/proportions.h"
#include "doppel/synth/body_field.h"

namespace doppel::synth {

namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;

BodyJoints plan_joints() {
  BodyJoints joints;
  const auto pair = [&](const std::string& part, const Vector3d& left) {
    joints.positions["left_" + part] = left;
    joints.positions["right_" + part] = mirrored(left);
  };
  pair("clavicle", BodyPlan::clavicle());
  pair("shoulder", BodyPlan::shoulder());
  pair("elbow", BodyPlan::elbow());
  pair("wrist", BodyPlan::wrist());
  pair("fingertip", BodyPlan::fingertip());
  pair("hip", BodyPlan::hip());
  pair("knee", BodyPlan::knee());
  pair("ankle", BodyPlan::ankle());
  pair("toe", BodyPlan::toe());
  // The head of the actor turns about a point below the base of the neck. Neck and head as on the average woman, at the
  // actor's stature:
  joints.positions["neck"] = {0, 1.487, -0.010};
  joints.positions["head"] = {0, 1.597, -0.004};
  joints.positions["head_top"] = BodyPlan::head_top();
  complete_joints(joints);
  return joints;
}

/// The segment to which a joint of the actor's skeleton is fixed: the one that begins there.
Segment segment_of_joint(const std::string& joint) {
  if (joint.starts_with("Root")) return kTrunkSegment;
  if (joint == "HeadEE") return kHeadSegment;
  if (joint.starts_with("Head")) return kNeckSegment;
  const bool left = joint.starts_with("Left");
  const std::string part = joint.substr(left ? 4 : 5);
  const auto side = [&](Segment segment) { return static_cast<Segment>(segment + (left ? 0 : kSideSegments)); };
  if (part.starts_with("Shoulder")) return kTrunkSegment;
  if (part == "ForeArmEE") return side(kLeftHandSegment);
  if (part.starts_with("ForeArm")) return side(kLeftForearmSegment);
  if (part.starts_with("Arm")) return side(kLeftArmSegment);
  if (part.starts_with("UpLeg")) return side(kLeftThighSegment);
  if (part.starts_with("Leg")) return side(kLeftShinSegment);
  return side(kLeftFootSegment);
}

/// Moves the joints, which stand in the rest pose without rotation, and the landmarks on them.
void move_skeleton(Character& c, const BodyWarp::Map& map) {
  std::vector<Vector3d> from, to;
  const Vector3d root = BodyPlan::root();
  for (Joint& joint : c.skeleton.joints) {
    const Vector3d position =
        joint.parent < 0 ? Vector3d(root + joint.offset) : Vector3d(from[joint.parent] + joint.offset);
    from.push_back(position);
    to.push_back(map.bone_point(segment_of_joint(joint.name), position));
    if (joint.parent >= 0) joint.offset = to.back() - to[joint.parent];
  }
  for (Marker& marker : c.skeleton.markers) {
    const std::string& joint = c.skeleton.joints[marker.joint].name;
    const Segment segment = joint == "Head_rx" ? kHeadSegment : segment_of_joint(joint);
    marker.position = map.bone_point(segment, from[marker.joint] + marker.position) - to[marker.joint];
  }
  c.rest_dofs[*c.skeleton.find_dof("Root_ty")] = to.front().y();
}

Segment segment_of_part(Part part) {
  if (part < kLeftArm) return kTrunkSegment;
  return static_cast<Segment>(kLeftArmSegment + (part - kLeftArm));
}

/// The affine map that is nearest to the warp around the axis of a part.
Affine3d affine_warp(const BodyWarp::Map& map, Part part) {
  constexpr int kAlong = 5, kAround = 8;
  const PartAxis axis = part_axis(part);
  const Vector3d along = (axis.to - axis.from).normalized(), side = along.unitOrthogonal(), other = along.cross(side);
  SegmentWeights weights = SegmentWeights::Zero();
  weights[segment_of_part(part)] = 1;
  Eigen::Matrix<double, kAlong * kAround, 4> from;
  Eigen::Matrix<double, kAlong * kAround, 3> to;
  for (int i = 0; i < kAlong * kAround; ++i) {
    const double angle = 2 * M_PI * (i % kAround) / kAround, t = (i / kAround) / (kAlong - 1.0);
    const Vector3d p =
        axis.from + t * (axis.to - axis.from) + 0.75 * axis.radius * (std::cos(angle) * side + std::sin(angle) * other);
    from.row(i) << p.transpose(), 1;
    to.row(i) = map.point(p, weights).transpose();
  }
  Affine3d fitted;
  fitted.affine() = from.colPivHouseholderQr().solve(to).transpose();
  fitted.makeAffine();
  return fitted;
}

std::vector<Affine3d> warp_parts(const BodyWarp::Map& map) {
  std::vector<Affine3d> warps(kNumParts, Affine3d::Identity());
  for (int part = 0; part < kNumParts; ++part)
    if (part != kSkirt && part != kHead && part != kHair) warps[part] = affine_warp(map, static_cast<Part>(part));
  return warps;
}

}  // namespace

std::vector<double> actor_measures() {
  const BodyJoints joints = plan_joints();
  std::vector<double> own = mean_measures(BodyBuild::woman);
  const auto length = [&](const char* name, const char* from, const char* to) {
    own[measure_index(name)] = (joints.at(to) - joints.at(from)).norm();
  };
  length("upper_arm_length", "left_shoulder", "left_elbow");
  length("forearm_length", "left_elbow", "left_wrist");
  length("hand_length", "left_wrist", "left_fingertip");
  length("shoulder_breadth", "left_shoulder", "right_shoulder");
  length("hip_breadth", "left_hip", "right_hip");
  length("thigh_length", "left_hip", "left_knee");
  length("shin_length", "left_knee", "left_ankle");
  length("neck_length", "neck", "head");
  length("head_height", "head", "head_top");
  own[measure_index("trunk_length")] =
      (joints.at("neck") - 0.5 * (joints.at("left_hip") + joints.at("right_hip"))).norm();
  own[measure_index("ankle_height")] = joints.at("left_ankle").y();
  return own;
}

std::vector<double> measures_of(const std::string& body) {
  if (body == "average") return mean_measures();
  const std::string random = "random:";
  std::uint64_t seed = 0;
  const char* end = body.data() + body.size();
  if (body.starts_with(random)) {
    const auto [stop, error] = std::from_chars(body.data() + random.size(), end, seed);
    if (error == std::errc() && stop == end) return random_measures(seed);
  }
  fail<UsageError>("doppel synth: there is no body '{}'; use actor, average, or random: with a number, e.g. random:7",
                   body);
}

void give_body(Actor& actor, std::span<const double> measures) {
  constexpr int kRounds = 4;
  check_measures(measures);
  Character& c = actor.character;
  const BodyWarp warp(plan_joints());
  const BodyWarp::Map map = warp.map(proportional_factors(measures, actor_measures()));
  const std::vector<SegmentWeights> weights = segment_weights(c.mesh, c.skin, warp.reference(), kRounds);
  for (int v = 0; v < c.num_vertices(); ++v) {
    Vector3d& vertex = c.mesh.vertices[v];
    const Vector3d moved = map.point(vertex, weights[v]);
    actor.hang[v] = map.point(vertex + actor.hang[v], weights[v]) - moved;
    vertex = moved;
  }
  move_skeleton(c, map);
  actor.part_warps = warp_parts(map);
}

}  // namespace doppel::synth
