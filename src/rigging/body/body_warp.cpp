#include "doppel/rigging/body/body_warp.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/geometry/distance_field.h"
#include "doppel/geometry/smooth_values.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

int segment_of_bone(const std::string& bone) {
  for (const char* name : {"Root", "Spine", "Spine1", "Chest", "LeftShoulder", "RightShoulder"})
    if (bone == name) return kTrunkSegment;
  if (bone == "Neck") return kNeckSegment;
  if (bone == "Head") return kHeadSegment;
  const bool right = bone.starts_with("Right");
  const std::string part = right ? bone.substr(5) : bone.starts_with("Left") ? bone.substr(4) : "";
  const std::array<std::pair<const char*, int>, 8> parts{{{"Arm", kLeftArmSegment},
                                                          {"ForeArm", kLeftForearmSegment},
                                                          {"ForeArmRoll", kLeftForearmSegment},
                                                          {"Hand", kLeftHandSegment},
                                                          {"UpLeg", kLeftThighSegment},
                                                          {"Leg", kLeftShinSegment},
                                                          {"Foot", kLeftFootSegment},
                                                          {"ToeBase", kLeftFootSegment}}};
  for (const auto& [name, segment] : parts)
    if (part == name) return segment + (right ? kSideSegments : 0);
  if (part.starts_with("Hand")) return kLeftHandSegment + (right ? kSideSegments : 0);  // a finger
  fail(
      "the segments of a body: the skin has a bone '{}', but the parts of a body are known only for the bones of "
      "Doppel's skeletons (Root, Spine, Chest, Neck, Head, LeftArm, ...)",
      bone);
}

/// Moves a share of one segment's weight to the segment beyond a joint, over `width` around the joint.
void divide(std::vector<SegmentWeights>& weights, const TriangleMesh& mesh, int from, int to, const Vector3d& joint,
            const Vector3d& along, double width) {
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const double beyond = smooth_step(-width, width, (mesh.vertices[v] - joint).dot(along));
    weights[v][to] += beyond * weights[v][from];
    weights[v][from] *= 1 - beyond;
  }
}

/// A value at a level of a segment.
struct Level {
  double t, value;
};

/// Smooth from level to level, constant before the first and after the last.
template <std::size_t Count>
double at_level(const std::array<Level, Count>& levels, double t) {
  double value = levels[0].value;
  for (std::size_t i = 1; i < Count; ++i)
    value += (levels[i].value - levels[i - 1].value) * smooth_step(levels[i - 1].t, levels[i].t, t);
  return value;
}

}  // namespace

std::vector<SegmentWeights> segment_weights(const TriangleMesh& mesh, const SkinningWeights& skin,
                                            const BodyJoints& joints, int rounds) {
  std::vector<int> segment;
  for (const std::string& bone : skin.bones) segment.push_back(segment_of_bone(bone));
  std::vector<SegmentWeights> weights(mesh.vertices.size(), SegmentWeights::Zero());
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const auto bones = skin.vertex_bones.row(v);
    const auto shares = skin.vertex_bones.row_of(skin.weights, v);
    for (std::size_t k = 0; k < bones.size(); ++k) weights[v][segment[bones[k]]] += shares[k];
  }
  const auto has = [&](int wanted) { return std::find(segment.begin(), segment.end(), wanted) != segment.end(); };
  if (!has(kNeckSegment)) {
    for (SegmentWeights& w : weights) std::swap(w[kNeckSegment], w[kHeadSegment]);
    const Vector3d neck = joints.at("head") - joints.at("neck");
    divide(weights, mesh, kNeckSegment, kHeadSegment, joints.at("head"), neck.normalized(), 0.4 * neck.norm());
  }
  for (const bool left : {true, false}) {
    const int side = left ? 0 : kSideSegments;
    if (has(kLeftHandSegment + side)) continue;
    const std::string name = left ? "left_" : "right_";
    const Vector3d forearm = joints.at(name + "wrist") - joints.at(name + "elbow");
    divide(weights, mesh, kLeftForearmSegment + side, kLeftHandSegment + side, joints.at(name + "wrist"),
           forearm.normalized(), 0.1 * forearm.norm());
  }
  smooth_values(weights, MeshTopology(mesh), rounds);
  return weights;
}

/// How a segment widens at a level: factors to the side and to the front, and shifts in these directions, metres.
struct BodyWarp::Across {
  double side = 1, front = 1, shift_side = 0, shift_front = 0;
};

BodyWarp::BodyWarp(const BodyJoints& reference) : joints_(reference) {
  complete_joints(joints_);
  const Vector3d hips = 0.5 * (joints_.at("left_hip") + joints_.at("right_hip")), left = Vector3d::UnitX();
  set_frame(kTrunkSegment, hips, joints_.at("neck"), left, kTrunkLength);
  set_frame(kNeckSegment, joints_.at("neck"), joints_.at("head"), left, kNeckLength);
  set_frame(kHeadSegment, joints_.at("head"), joints_.at("head_top"), left, kHeadHeight);
  set_limbs(true);
  set_limbs(false);
}

void BodyWarp::set_frame(int segment, const Vector3d& from, const Vector3d& to, const Vector3d& side, Factor along) {
  Frame& frame = frames_[segment];
  frame.origin = from;
  frame.length = (to - from).norm();
  frame.along = along;
  const Vector3d axis = (to - from) / frame.length;
  const Vector3d across = (side - side.dot(axis) * axis).normalized();
  // The third axis is chosen to the front, whatever the handedness: only factors along the axes matter.
  Vector3d front = across.cross(axis).normalized();
  if (front.z() < 0) front = -front;
  frame.axes << axis, across, front;
}

void BodyWarp::set_limbs(bool left) {
  const std::string name = left ? "left_" : "right_";
  const int side = left ? 0 : kSideSegments;
  const auto at = [&](const char* part) { return joints_.at(name + part); };
  const Vector3d outward = left ? Vector3d(Vector3d::UnitX()) : Vector3d(-Vector3d::UnitX());
  set_frame(kLeftArmSegment + side, at("shoulder"), at("elbow"), Vector3d::UnitZ(), kUpperArmLength);
  set_frame(kLeftForearmSegment + side, at("elbow"), at("wrist"), Vector3d::UnitZ(), kForearmLength);
  set_frame(kLeftHandSegment + side, at("wrist"), at("fingertip"), Vector3d::UnitZ(), kHandLength);
  set_frame(kLeftThighSegment + side, at("hip"), at("knee"), outward, kThighLength);
  set_frame(kLeftShinSegment + side, at("knee"), at("ankle"), outward, kShinLength);
  // The foot lies level: its third axis points up.
  Vector3d toe = at("toe_end");
  toe.y() = at("ankle").y();
  Frame& foot = frames_[kLeftFootSegment + side];
  foot.origin = at("ankle");
  foot.length = (toe - foot.origin).norm();
  foot.along = kFootLength;
  const Vector3d forward = (toe - foot.origin) / foot.length;
  foot.axes << forward, forward.cross(Vector3d::UnitY()), Vector3d::UnitY();
}

BodyWarp::Across BodyWarp::across(int segment, double t, const Map& map) const {
  const BodyFactors& f = map.factors_;
  const auto round = [](double factor) { return Across{factor, factor, 0, 0}; };
  const double elbow = std::sqrt(f[kUpperArmGirth] * f[kForearmGirth]);
  const int left = segment >= kRightArmSegment ? segment - kSideSegments : segment;
  if (left == kTrunkSegment) {
    // Shoulders are as thick as chest and arms.
    const double shoulder = std::sqrt(f[kChestDepth] * f[kUpperArmGirth]);
    Across a;
    a.side = at_level<5>({{{kHipLevel, f[kHipGirth]},
                           {kWaistLevel, f[kWaistBreadth]},
                           {kChestLevel, f[kChestBreadth]},
                           {kShoulderLevel, f[kShoulderJoints]},
                           {1.0, f[kNeckGirth]}}},
                         t);
    a.front = at_level<5>({{{kHipLevel, f[kHipGirth]},
                            {kWaistLevel, f[kWaistDepth]},
                            {kChestLevel, f[kChestDepth]},
                            {kShoulderLevel, shoulder},
                            {1.0, f[kNeckGirth]}}},
                          t);
    // A belly grows to the front: the back stays near the spine. The distance of the back from the axis is about a
    // fifth of the trunk's length.
    const double to_front = at_level<4>({{{kHipLevel, 0.0}, {kWaistLevel, 0.7}, {kChestLevel, 0.4}, {0.9, 0.0}}}, t);
    a.shift_front = to_front * 0.2 * frames_[kTrunkSegment].length * (a.front - f[kTrunkLength]);
    return a;
  }
  switch (left) {
    case kNeckSegment:
      return round(f[kNeckGirth]);
    case kHeadSegment:
      return {f[kHeadBreadth], f[kHeadDepth], 0, 0};
    case kLeftArmSegment:
      return round(at_level<2>({{{kUpperArmLevel, f[kUpperArmGirth]}, {1.0, elbow}}}, t));
    case kLeftForearmSegment:
      return round(at_level<3>({{{0.0, elbow}, {kForearmLevel, f[kForearmGirth]}, {kWristLevel, f[kWristGirth]}}}, t));
    case kLeftHandSegment:
      return round(f[kHandBreadth]);
    case kLeftShinSegment:
      return round(
          at_level<3>({{{0.0, f[kKneeGirth]}, {kCalfLevel, f[kCalfGirth]}, {kAnkleLevel, f[kAnkleGirth]}}}, t));
    case kLeftFootSegment:
      return {f[kFootBreadth], f[kAnkleHeight], 0, 0};
    default:
      break;
  }
  // At the hip joint the thigh is as wide as the hips, so that trunk and thigh agree there. The thigh widens outwards:
  // its inner side keeps its distance from the middle, so that the thighs do not meet.
  const Frame& frame = frames_[segment];
  const double level = std::clamp(t, 0.0, 1.0);
  Across a = round(at_level<3>({{{0.0, f[kHipGirth]}, {kThighLevel, f[kThighGirth]}, {kKneeLevel, f[kKneeGirth]}}}, t));
  const double radius = 0.205 * frame.length * (1 - 0.35 * level);
  const double middle = std::abs(frame.origin.x() + level * frame.length * frame.axes(0, 0));
  const double moved = std::abs(map.origin_[segment].x() + f[kThighLength] * level * frame.length * frame.axes(0, 0));
  const double share = 1 - smooth_step(0.2, 1.0, t);
  a.shift_side = share * (a.side * radius + f[kHipJoints] * (middle - radius) - moved);
  return a;
}

Vector3d BodyWarp::segment_point(int segment, const Vector3d& reference, const Map& map) const {
  const Frame& frame = frames_[segment];
  const Vector3d local = frame.axes.transpose() * (reference - frame.origin);
  const Across a = across(segment, local.x() / frame.length, map);
  return map.origin_[segment] + frame.axes * Vector3d(map.factors_[frame.along] * local.x(),
                                                      a.side * local.y() + a.shift_side,
                                                      a.front * local.z() + a.shift_front);
}

Vector3d BodyWarp::bone_point(int segment, const Vector3d& reference, const Map& map) const {
  const int left = segment >= kRightArmSegment ? segment - kSideSegments : segment;
  if (left == kHeadSegment || left == kLeftHandSegment || left == kLeftFootSegment)
    return segment_point(segment, reference, map);
  const Frame& frame = frames_[segment];
  const double along = map.factors_[frame.along];
  const double side = segment == kTrunkSegment ? map.factors_[kShoulderJoints] : along;
  const Vector3d local = frame.axes.transpose() * (reference - frame.origin);
  return map.origin_[segment] + frame.axes * local.cwiseProduct(Vector3d(along, side, along));
}

void BodyWarp::put_limbs(Map& map, int side) const {
  const auto end = [&](int segment) {
    const Frame& frame = frames_[segment];
    return Vector3d(map.origin_[segment] + map.factors_[frame.along] * frame.length * frame.axes.col(0));
  };
  map.origin_[kLeftArmSegment + side] = bone_point(kTrunkSegment, frames_[kLeftArmSegment + side].origin, map);
  map.origin_[kLeftForearmSegment + side] = end(kLeftArmSegment + side);
  map.origin_[kLeftHandSegment + side] = end(kLeftForearmSegment + side);
  const Vector3d& hips = frames_[kTrunkSegment].origin;
  map.origin_[kLeftThighSegment + side] =
      map.origin_[kTrunkSegment] + map.factors_[kHipJoints] * (frames_[kLeftThighSegment + side].origin - hips);
  map.origin_[kLeftShinSegment + side] = end(kLeftThighSegment + side);
  map.origin_[kLeftFootSegment + side] = end(kLeftShinSegment + side);
}

void BodyWarp::put_origins(Map& map) const {
  map.origin_[kTrunkSegment] = frames_[kTrunkSegment].origin;
  map.origin_[kNeckSegment] = bone_point(kTrunkSegment, frames_[kNeckSegment].origin, map);
  map.origin_[kHeadSegment] = bone_point(kNeckSegment, frames_[kHeadSegment].origin, map);
  for (const int side : {0, kSideSegments}) put_limbs(map, side);
  const double ankle = 0.5 * (map.origin_[kLeftFootSegment].y() + map.origin_[kRightFootSegment].y());
  const double wanted =
      0.5 * map.factors_[kAnkleHeight] * (frames_[kLeftFootSegment].origin.y() + frames_[kRightFootSegment].origin.y());
  for (Vector3d& origin : map.origin_) origin.y() += wanted - ankle;
}

BodyWarp::Map BodyWarp::map(const BodyFactors& factors) const {
  Map map;
  map.warp_ = this;
  map.factors_ = factors;
  put_origins(map);
  return map;
}

Vector3d BodyWarp::Map::point(const Vector3d& reference, const SegmentWeights& weights) const {
  constexpr double kMinWeight = 1e-9;
  Vector3d sum = Vector3d::Zero();
  for (int s = 0; s < kNumSegments; ++s)
    if (weights[s] > kMinWeight) sum += weights[s] * warp_->segment_point(s, reference, *this);
  return sum;
}

Vector3d BodyWarp::Map::bone_point(Segment segment, const Vector3d& reference) const {
  return warp_->bone_point(segment, reference, *this);
}

BodyJoints BodyWarp::Map::joints() const {
  BodyJoints moved;
  const auto segment_of = [](const std::string& name) {
    const int side = name.starts_with("right_") ? kSideSegments : 0;
    const std::string part = side != 0 ? name.substr(6) : name.starts_with("left_") ? name.substr(5) : name;
    for (const char* trunk : {"pelvis", "spine", "chest", "neck", "clavicle", "shoulder"})
      if (part == trunk) return static_cast<int>(kTrunkSegment);
    for (const char* hand : {"hand", "fingertip", "wrist"})
      if (part == hand) return kLeftHandSegment + side;
    for (const Finger& finger : kFingers)
      if (part.starts_with(finger.point)) return kLeftHandSegment + side;
    for (const char* foot : {"toe", "toe_end", "heel", "ankle"})
      if (part == foot) return kLeftFootSegment + side;
    return part == "elbow"  ? kLeftForearmSegment + side
           : part == "hip"  ? kLeftThighSegment + side
           : part == "knee" ? kLeftShinSegment + side
                            : static_cast<int>(kHeadSegment);
  };
  for (const auto& [name, position] : warp_->joints_.positions)
    moved.positions[name] = warp_->bone_point(segment_of(name), position, *this);
  return moved;
}

}  // namespace doppel
