#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/geometry/decompositions.h"
#include "doppel/rigging/joints/body_skeleton.h"
#include "doppel/rigging/joints/fingers.h"
#include "doppel/rigging/joints/head_measures.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// Fixes points of the rest pose to joints.
class MarkerBuilder {
 public:
  MarkerBuilder(BodySkeleton& body, const BodyJoints& all_joints, const TriangleMesh& template_mesh)
      : joints(all_joints), mesh(template_mesh), body_(body), rest_from_joint_(body.skeleton.pose(body.rest_dofs)) {}

  /// @param bone the last joint of this bone carries the marker
  void add(const std::string& name, const std::string& bone, const Vector3d& position) {
    constexpr double kSize = 0.02;
    const int joint = body_.skeleton.joint_of_bone(bone, BoneRule::exact);
    body_.skeleton.markers.push_back({name, joint, rest_from_joint_[joint].inverse(Eigen::Isometry) * position, kSize});
  }
  /// The direction in the rest pose of an axis of a bone's frame.
  Vector3d direction(const std::string& bone, const Vector3d& axis) const {
    return rest_from_joint_[body_.skeleton.joint_of_bone(bone, BoneRule::exact)].linear() * axis;
  }
  /// The surface on a ray, or a point at `otherwise` metres when the ray leaves without a hit.
  Vector3d surface(const Vector3d& from, const Vector3d& direction, double farthest, double otherwise) const {
    const auto hit = last_hit(mesh, from, direction, farthest);
    return hit ? *hit : Vector3d(from + otherwise * direction);
  }

  const BodyJoints& joints;
  const TriangleMesh& mesh;

 private:
  BodySkeleton& body_;
  std::vector<Eigen::Affine3d> rest_from_joint_;
};

struct Side {
  std::string bone, name;  // "Left", "left_"
  double sign;
};
const std::array<Side, 2> kSides{{{"Left", "left_", 1.0}, {"Right", "right_", -1.0}}};

/// A point of the face or the head: on the surface in its direction from the middle of the head.
Vector3d on_head(const MarkerBuilder& b, const HeadMeasures& head, const Vector3d& local) {
  const Vector3d middle = head.world({0.3 * local.x(), local.y(), -0.5}), guess = head.world(local);
  const double away = (guess - middle).norm();
  const auto hit = last_hit(b.mesh, middle, (guess - middle) / away, 1.4 * away);
  return hit ? *hit : guess;
}

void add_head_markers(MarkerBuilder& b) {
  const HeadMeasures head = measure_head(b.mesh, b.joints);
  const auto add = [&](const std::string& name, const Vector3d& local) {
    b.add(name, "Head", b.joints.has(name) ? b.joints.at(name) : on_head(b, head, local));
  };
  b.add("nose", "Head", head.nose);
  b.add("head_top", "Head", head.top);
  for (const Side& side : kSides) {
    add(side.name + "eye", {side.sign * 0.14, 0.17, -0.12});
    add(side.name + "eye_inner", {side.sign * 0.075, 0.165, -0.1});
    add(side.name + "eye_outer", {side.sign * 0.205, 0.17, -0.18});
    add(side.name + "mouth", {side.sign * 0.11, -0.17, -0.1});
    add(side.name + "ear", {side.sign * 0.33, 0.08, -0.53});
  }
  const std::vector<Vector3d> face = face_points();
  for (std::size_t i = 0; i < face.size(); ++i) add("face-" + std::to_string(i), face[i]);
  for (const NamedFacePoint& point : face_mesh_points()) add(point.name, point.local);
}

void add_trunk_markers(MarkerBuilder& b) {
  const auto middle = [&](const char* part) {
    return Vector3d(0.5 * (b.joints.at(std::string("left_") + part) + b.joints.at(std::string("right_") + part)));
  };
  b.add("neck", "Chest", middle("shoulder"));
  b.add("neck_base", "Neck", 0.5 * (b.joints.at("neck") + b.joints.at("head")));
  b.add("mid_hip", "Root", middle("hip"));
  b.add("spine", "Spine1", 0.5 * (middle("hip") + middle("shoulder")));
}

/// The direction to the thumb: across the flat of the hand where the surface tells, else as the elbow bends.
Vector3d thumb_direction(const MarkerBuilder& b, const Side& side, const Vector3d& along, double length) {
  const Vector3d& wrist = b.joints.at(side.name + "wrist");
  Vector3d ahead = b.direction(side.bone + "Hand", Vector3d::UnitZ());
  ahead = (ahead - ahead.dot(along) * along).normalized();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Vector3d sum = Vector3d::Zero();
  std::vector<Vector3d> across;
  for (const Vector3d& p : b.mesh.vertices) {
    const Vector3d away = p - wrist;
    const double t = away.dot(along);
    if (t < 0.25 * length || t > 0.6 * length || (away - t * along).norm() > 0.4 * length) continue;
    across.emplace_back(away - t * along);
    sum += across.back();
  }
  if (across.size() < 12) return ahead;
  for (const Vector3d& p : across) {
    const Vector3d d = p - sum / static_cast<double>(across.size());
    spread += d * d.transpose();
  }
  const auto [spreads, axes] = symmetric_eigen(spread);
  if (spreads[2] < 2.5 * spreads[1]) return ahead;
  const Vector3d wide = axes.col(2);
  return wide.dot(ahead) < 0 ? Vector3d(-wide) : wide;
}

/// The points of the fingers of a hand, which are known or follow from proportions.
/// @return by their names in BodyJoints
std::map<std::string, Vector3d> points_of_fingers(const MarkerBuilder& b, const Side& side) {
  std::map<std::string, Vector3d> points;
  if (has_fingers(b.joints, side.name)) {
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k)
        points[finger_point(side.name, finger, k)] = b.joints.at(finger_point(side.name, finger, k));
    return points;
  }
  const Vector3d& wrist = b.joints.at(side.name + "wrist");
  const Vector3d hand = b.joints.at(side.name + "fingertip") - wrist;
  const double length = hand.norm();
  const Vector3d along = hand / length, thumb = thumb_direction(b, side, along, length);
  // Positions along the hand and towards the thumb, of its length.
  struct OnHand {
    double along, across;
  };
  constexpr std::array<OnHand, 4> kThumb{{{0.13, 0.13}, {0.33, 0.24}, {0.48, 0.31}, {0.62, 0.35}}};
  constexpr std::array<std::array<OnHand, 2>, 4> kKnuckleAndTip{{{{{0.49, 0.12}, {0.93, 0.15}}},
                                                                 {{{0.49, 0.02}, {1.0, 0.03}}},
                                                                 {{{0.46, -0.07}, {0.94, -0.08}}},
                                                                 {{{0.42, -0.15}, {0.79, -0.18}}}}};
  constexpr std::array<double, 4> kJoint{0.0, 0.45, 0.75, 1.0};
  for (std::size_t f = 0; f < kFingers.size(); ++f)
    for (std::size_t k = 0; k < kFingerPoints; ++k) {
      OnHand at = kThumb[k];
      if (f > 0) {
        const auto& [knuckle, tip] = kKnuckleAndTip[f - 1];
        at = {knuckle.along + kJoint[k] * (tip.along - knuckle.along),
              knuckle.across + kJoint[k] * (tip.across - knuckle.across)};
      }
      points[finger_point(side.name, kFingers[f], static_cast<int>(k) + 1)] =
          wrist + length * (at.along * along + at.across * thumb);
    }
  return points;
}

void add_hand_markers(MarkerBuilder& b, const Side& side) {
  const std::string hand = side.bone + "Hand";
  const bool fingers = has_fingers(b.joints, side.name);
  const std::map<std::string, Vector3d> points = points_of_fingers(b, side);
  b.add(side.name + "hand_root", hand, b.joints.at(side.name + "wrist"));
  for (const Finger& finger : kFingers)
    for (int k = 1; k <= kFingerPoints; ++k) {
      // A joint is where its bone begins; the tip is at the end of the last bone.
      const std::string bone = fingers ? finger_bone(side.name, finger, std::min(k, kFingerBones)) : hand;
      const std::string name = finger_point(side.name, finger, k);
      b.add(name, bone, points.at(name));
    }
  // Layouts of the body have these three. They turn with the hand alone, so fingers stay still without finger points.
  b.add(side.name + "thumb", hand, points.at(side.name + "thumb2"));
  b.add(side.name + "index", hand, points.at(side.name + "forefinger1"));
  b.add(side.name + "pinky", hand, points.at(side.name + "pinky_finger1"));
}

void add_arm_markers(MarkerBuilder& b, const Side& side) {
  const Vector3d shoulder = b.joints.at(side.name + "shoulder"), elbow = b.joints.at(side.name + "elbow");
  b.add(side.name + "shoulder", side.bone + "Arm", shoulder);
  b.add(side.name + "elbow", side.bone + "ForeArm", elbow);
  b.add(side.name + "wrist", side.bone + "Hand", b.joints.at(side.name + "wrist"));
  const double arm = (elbow - shoulder).norm();
  const Vector3d up = b.direction("Chest", Vector3d::UnitY()),
                 ahead = b.direction(side.bone + "Arm", Vector3d::UnitZ());
  b.add(side.name + "acromion", side.bone + "Shoulder", b.surface(shoulder, up, 0.3 * arm, 0.1 * arm));
  b.add(side.name + "olecranon", side.bone + "ForeArm", b.surface(elbow, -ahead, 0.25 * arm, 0.12 * arm));
  b.add(side.name + "cubital_fossa", side.bone + "ForeArm", b.surface(elbow, ahead, 0.25 * arm, 0.12 * arm));
}

/// The vertices of a foot: nearer to its line than to that of the other foot, and not above the ankle.
std::vector<Vector3d> foot_vertices(const MarkerBuilder& b, const Side& side, double shin, const Vector3d& down) {
  const auto from_line = [&](const Vector3d& p, const std::string& name) {
    const Vector3d a = b.joints.at(name + "ankle"), along = b.joints.at(name + "toe_end") - a;
    return (p - a - std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0) * along).norm();
  };
  const std::string other = side.name == "left_" ? "right_" : "left_";
  std::vector<Vector3d> found;
  for (const Vector3d& p : b.mesh.vertices) {
    if ((p - b.joints.at(side.name + "ankle")).dot(down) < 0.05 * shin) continue;
    const double away = from_line(p, side.name);
    if (away < 0.35 * shin && away < from_line(p, other)) found.push_back(p);
  }
  return found;
}

void add_leg_markers(MarkerBuilder& b, const Side& side) {
  const Vector3d knee = b.joints.at(side.name + "knee"), ankle = b.joints.at(side.name + "ankle");
  b.add(side.name + "hip", side.bone + "UpLeg", b.joints.at(side.name + "hip"));
  b.add(side.name + "knee", side.bone + "Leg", knee);
  b.add(side.name + "ankle", side.bone + "Foot", ankle);
  const double shin = (ankle - knee).norm();
  const Vector3d down = (ankle - knee) / shin, foot = b.joints.at(side.name + "toe_end") - ankle;
  const Vector3d ahead = (foot - foot.dot(down) * down).normalized(), outward = side.sign * ahead.cross(down);
  const std::vector<Vector3d> vertices = foot_vertices(b, side, shin, down);
  // The vertex that lies farthest in a direction.
  const auto extreme = [&](const Vector3d& direction, const Vector3d& otherwise) {
    const auto best = std::max_element(vertices.begin(), vertices.end(), [&](const Vector3d& p, const Vector3d& q) {
      return p.dot(direction) < q.dot(direction);
    });
    return best == vertices.end() ? otherwise : *best;
  };
  const Vector3d& toe_end = b.joints.at(side.name + "toe_end");
  const Vector3d& heel = b.joints.at(side.name + "heel");
  b.add(side.name + "big_toe", side.bone + "ToeBase", extreme(ahead - 0.4 * outward, toe_end));
  b.add(side.name + "small_toe", side.bone + "ToeBase", extreme(ahead + outward, toe_end + 0.1 * shin * outward));
  b.add(side.name + "heel", side.bone + "Foot", extreme(-ahead + 0.3 * down, heel));
}

int label_of_head(const Vector3d& local) {
  constexpr int kHair = 2, kFace = 13;
  const bool front = local.z() > -0.5 && local.y() < 0.3;
  const bool below = local.y() < -0.2 && local.z() > -0.75;
  return front || below ? kFace : kHair;
}

}  // namespace

void add_body_markers(BodySkeleton& body, const BodyJoints& given, const TriangleMesh& mesh) {
  BodyJoints joints = given;
  complete_joints(joints);
  MarkerBuilder builder(body, joints, mesh);
  add_head_markers(builder);
  add_trunk_markers(builder);
  for (const Side& side : kSides) {
    add_arm_markers(builder, side);
    add_hand_markers(builder, side);
    add_leg_markers(builder, side);
  }
}

std::vector<int> region_labels(const TriangleMesh& mesh, const SkinningWeights& skin, const BodyJoints& given) {
  constexpr int kUpperClothes = 5, kPants = 9, kFace = 13, kLeftArm = 14, kLeftShoe = 18;
  BodyJoints joints = given;
  complete_joints(joints);
  const HeadMeasures head = measure_head(mesh, joints);
  const Vector3d up = pelvis_frame(joints).up;
  std::vector<int> labels;
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const Vector3d& p = mesh.vertices[v];
    const std::string& bone = skin.bones[skin.vertex_bones.row(v).front()];
    const int right = bone.starts_with("Right") ? 1 : 0;
    const auto ends = [&](const char* part) { return bone.ends_with(part); };
    if (bone == "Head")
      labels.push_back(label_of_head(head.local(p)));
    else if (bone == "Neck")
      labels.push_back(kFace);
    else if (ends("ForeArm") || ends("ForeArmRoll") || bone.find("Hand") != std::string::npos)
      labels.push_back(kLeftArm + right);
    else if (ends("Foot") || ends("ToeBase"))
      labels.push_back(kLeftShoe + right);
    else if (ends("Leg") || (bone == "Root" && (p - joints.at("pelvis")).dot(up) < 0))
      labels.push_back(kPants);
    else
      labels.push_back(kUpperClothes);
  }
  return labels;
}

}  // namespace doppel
