#include "doppel/rigging/joints/fingers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "doppel/geometry/smooth_values.h"
#include "doppel/rigging/weights/weight_field.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr int kHandBones = 1 + static_cast<int>(kFingers.size()) * kFingerBones;  ///< the hand itself, then fingers
using HandShares = Eigen::Matrix<double, kHandBones, 1>;

struct Segment {
  int bone;  ///< 0: the hand; 1 + 3 f + k: bone k + 1 of finger f
  Vector3d from, to;
};

double distance(const Vector3d& p, const Segment& segment) {
  const Vector3d along = segment.to - segment.from;
  const double t = std::clamp((p - segment.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p - segment.from - t * along).norm();
}

std::vector<Segment> hand_segments(const BodyJoints& joints, const std::string& side) {
  const Vector3d& wrist = joints.at(side + "wrist");
  std::vector<Segment> segments;
  for (std::size_t f = 0; f < kFingers.size(); ++f) {
    const auto point = [&](int k) { return joints.at(finger_point(side, kFingers[f], k)); };
    segments.push_back({0, wrist, point(1)});
    for (int k = 1; k <= kFingerBones; ++k)
      segments.push_back({kFingerBones * static_cast<int>(f) + k, point(k), point(k + 1)});
  }
  return segments;
}

/// The shares of the hand's bones in the motion of a point; they sum to 1.
HandShares shares_at(const Vector3d& p, const std::vector<Segment>& segments, double width) {
  HandShares nearest = HandShares::Constant(std::numeric_limits<double>::infinity());
  for (const Segment& segment : segments) nearest[segment.bone] = std::min(nearest[segment.bone], distance(p, segment));
  HandShares shares = ((nearest.minCoeff() - nearest.array()) / width).exp();
  return shares / shares.sum();
}

/// The same for each vertex that moves with the hand; others have the hand alone.
std::vector<HandShares> shares_of_vertices(const Character& character, const BodyJoints& joints,
                                           const std::string& side, const std::vector<double>& hand_weights) {
  constexpr double kWidth = 0.008;  // of the length of the hand
  constexpr int kRounds = 2;
  const double length = (joints.at(side + "fingertip") - joints.at(side + "wrist")).norm();
  const std::vector<Segment> segments = hand_segments(joints, side);
  std::vector<HandShares> shares(character.mesh.vertices.size(), HandShares::Unit(0));
  for (std::size_t v = 0; v < shares.size(); ++v)
    if (hand_weights[v] > 0.0) shares[v] = shares_at(character.mesh.vertices[v], segments, kWidth * length);
  smooth_values(shares, MeshTopology(character.mesh), kRounds);
  return shares;
}

void divide_one(Character& character, const BodyJoints& joints, const std::string& side) {
  const SkinningWeights& skin = character.skin;
  const std::string hand = side == "left_" ? "LeftHand" : "RightHand";
  const auto bone = std::find(skin.bones.begin(), skin.bones.end(), hand) - skin.bones.begin();
  const int n = character.num_vertices(), before = skin.num_bones();
  std::vector<std::string> bones = skin.bones;
  for (const Finger& finger : kFingers)
    for (int k = 1; k <= kFingerBones; ++k) bones.push_back(finger_bone(side, finger, k));

  WeightField field = WeightField::Zero(n, static_cast<int>(bones.size()));
  std::vector<double> hand_weights(static_cast<std::size_t>(n), 0.0);
  for (int v = 0; v < n; ++v) {
    const auto row = skin.vertex_bones.row(v);
    const auto weights = skin.vertex_bones.row_of(skin.weights, v);
    for (std::size_t i = 0; i < row.size(); ++i) field(v, row[i]) = static_cast<float>(weights[i]);
    hand_weights[static_cast<std::size_t>(v)] = field(v, bone);
  }
  const std::vector<HandShares> shares = shares_of_vertices(character, joints, side, hand_weights);
  for (int v = 0; v < n; ++v) {
    const HandShares divided = hand_weights[static_cast<std::size_t>(v)] * shares[static_cast<std::size_t>(v)];
    field(v, bone) = static_cast<float>(divided[0]);
    field.row(v).segment(before, kHandBones - 1) = divided.tail<kHandBones - 1>().cast<float>();
  }
  character.skin = sparse_weights(field, bones);
}

}  // namespace

std::string finger_bone(const std::string& side, const Finger& finger, int k) {
  return (side == "left_" ? "LeftHand" : "RightHand") + std::string(finger.bone) + std::to_string(k);
}

void divide_hand_weights(Character& character, const BodyJoints& joints) {
  for (const char* side : {"left_", "right_"})
    if (has_fingers(joints, side)) divide_one(character, joints, side);
  complete_character(character);
}

}  // namespace doppel
