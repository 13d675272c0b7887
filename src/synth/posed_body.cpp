#include "doppel/synth/posed_body.h"

#include <algorithm>
#include <string>

namespace doppel::synth {

namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;

constexpr double kFar = 10;        ///< metres, distance to a part that is too far away to matter
constexpr double kJoining = 0.05;  ///< metres, farther parts have no influence on the joined distance

std::string bone_of(Part part) {
  static const std::array<const char*, kLimbParts> kLimbBones{"Arm", "ForeArm", "ForeArm", "UpLeg", "Leg", "Foot"};
  if (part == kTorso || part == kSkirt) return "Root";
  if (part == kHead || part == kHair) return "Head";
  const bool left = part < kRightArm;
  return std::string(left ? "Left" : "Right") + kLimbBones[part - (left ? kLeftArm : kRightArm)];
}

/// The faces of trousers, arms and shoes.
std::vector<Triangle> bare_faces(const Actor& actor) {
  const std::array<int, 5> kBare{9, 14, 15, 18, 19};  // trousers, left and right arm, left and right shoe
  const auto bare = [&](int v) {
    return actor.looseness[v] < SkinPatch::kFirm &&
           std::find(kBare.begin(), kBare.end(), actor.character.labels[v]) != kBare.end();
  };
  std::vector<Triangle> faces;
  for (const Triangle& face : actor.character.mesh.faces)
    if (std::all_of(face.begin(), face.end(), bare)) faces.push_back(face);
  return faces;
}

}  // namespace

PosedBody::PosedBody(const Actor& actor)
    : character_(actor.character),
      groups_{{kTorso, kLeftThigh, kLeftShin, kLeftFoot, kRightThigh, kRightShin, kRightFoot},
              {kLeftForearm, kLeftHand},
              {kRightForearm, kRightHand}} {
  const std::vector<Affine3d> rest_from_joint = character_.skeleton.pose(character_.rest_dofs);
  for (const Group& group : groups_)
    for (const Part part : group) {
      PosedPart& posed = parts_[part];
      posed.joint = character_.skeleton.joint_of_bone(bone_of(part), BoneRule::exact);
      posed.ball = ball_around(part);
      posed.joint_from_rest = rest_from_joint[posed.joint].inverse();
      posed.warped = !actor.part_warps.empty();
      if (posed.warped) posed.joint_from_rest = posed.joint_from_rest * actor.part_warps[part];
      posed.world_from_rest.setIdentity();
    }
  move(character_.rest_dofs);
}

PosedBody::Ball PosedBody::ball_around(Part part) {
  const PartAxis axis = part_axis(part);
  return {0.5 * (axis.from + axis.to), 0.5 * (axis.from - axis.to).norm() + axis.radius};
}

void PosedBody::move(const std::vector<double>& dofs) {
  const std::vector<Affine3d> world_from_joint = character_.skeleton.pose(dofs);
  for (const Group& group : groups_)
    for (const Part part : group) {
      PosedPart& posed = parts_[part];
      const Affine3d before = posed.world_from_rest;
      posed.world_from_rest = world_from_joint[posed.joint] * posed.joint_from_rest;
      posed.rest_from_world = posed.world_from_rest.inverse(posed.warped ? Eigen::Affine : Eigen::Isometry);
      posed.before_from_now = before * posed.rest_from_world;
    }
}

PosedBody::Near PosedBody::near(const Group& group, const Vector3d& p) const {
  std::array<double, kNumParts> distances;
  distances.fill(kFar);
  Part nearest = group.front();
  for (const Part part : group) {
    const PosedPart& posed = parts_[part];
    const Vector3d q = posed.rest_from_world * p;
    const double outside = posed.ball.radius + kJoining;
    if ((q - posed.ball.centre).squaredNorm() > outside * outside) continue;
    distances[part] = field_.part_distance(part, q);
    if (distances[part] < distances[nearest]) nearest = part;
  }
  return {distances[nearest] < kFar ? BodyField::joined(distances) : kFar, nearest};
}

Vector3d PosedBody::gradient(const Group& group, const Vector3d& p) const {
  constexpr double kStep = 1e-4;
  Vector3d g;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStep * Vector3d::Unit(axis);
    g[axis] = (near(group, p + step).distance - near(group, p - step).distance) / (2 * kStep);
  }
  return g;
}

std::optional<Touch> PosedBody::touch(const Vector3d& p, double thickness) const {
  const Group* touched = nullptr;
  Near deepest{thickness, kTorso};
  for (const Group& group : groups_) {
    const Near found = near(group, p);
    if (found.distance < deepest.distance) deepest = found, touched = &group;
  }
  if (!touched) return std::nullopt;
  const Vector3d g = gradient(*touched, p);
  const double slope = g.norm();
  if (slope < 0.1) return std::nullopt;  // the middle of a part
  return Touch{(thickness - deepest.distance) / slope, g / slope, p - parts_[deepest.part].before_from_now * p};
}

double PosedBody::distance(const Vector3d& p) const {
  double nearest = kFar;
  for (const Group& group : groups_) nearest = std::min(nearest, near(group, p).distance);
  return nearest;
}

SkinPatch::SkinPatch(const Actor& actor)
    : faces_(bare_faces(actor)),
      at_border_(actor.character.mesh.vertices.size(), 0),
      now_(actor.character.mesh.vertices),
      before_(now_),
      tree_(now_, faces_) {
  std::vector<int> missing(at_border_.size(), 0);
  for (const Triangle& face : actor.character.mesh.faces)
    for (const int v : face) ++missing[v];
  for (const Triangle& face : faces_)
    for (const int v : face) --missing[v];
  std::transform(missing.begin(), missing.end(), at_border_.begin(), [](int n) { return n > 0; });
}

void SkinPatch::move(const std::vector<Vector3d>& surface) {
  before_.swap(now_);
  now_ = surface;
  tree_.refit(now_);
}

std::optional<Touch> SkinPatch::touch(const Vector3d& p, double thickness) const {
  constexpr double kMaxDepth = 0.05;  // metres; the closest point of a deeper point may be on another limb
  const TriangleTree::Hit hit = tree_.closest(p);
  if (hit.squared_distance > kMaxDepth * kMaxDepth) return std::nullopt;
  const Triangle& face = faces_[hit.face];
  Vector3d foot = Vector3d::Zero(), foot_before = foot;
  bool inside_patch = false;
  for (int k = 0; k < 3; ++k) {
    foot += hit.weights[k] * now_[face[k]];
    foot_before += hit.weights[k] * before_[face[k]];
    inside_patch = inside_patch || (hit.weights[k] > 0 && !at_border_[face[k]]);
  }
  if (!inside_patch) return std::nullopt;
  const Vector3d normal = (now_[face[1]] - now_[face[0]]).cross(now_[face[2]] - now_[face[0]]).normalized();
  const double height = normal.dot(p - foot);
  if (height >= thickness) return std::nullopt;
  return Touch{thickness - height, normal, foot - foot_before};
}

}  // namespace doppel::synth
