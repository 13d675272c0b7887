#include "doppel/rigging/joints/sticking.h"

#include <algorithm>
#include <array>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/statistics.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr int kSteps = 2;            // in the tree of bones
constexpr double kUsualReach = 2.0;  // of a bone, in its usual distance from its skin
constexpr double kReachOfEnd = 0.7;  // of a bone without bones below it, in its length

/// The bone that carries the nearest joint above a joint, or -1. @param bone_of_joint [J] or -1
int bone_above(const Skeleton& skeleton, const std::vector<int>& bone_of_joint, int joint) {
  for (int j = skeleton.joints[joint].parent; j >= 0; j = skeleton.joints[j].parent)
    if (bone_of_joint[j] >= 0) return bone_of_joint[j];
  return -1;
}

using BoneSegments = std::vector<std::vector<std::array<Vector3d, 2>>>;

/// The segments of each bone in the rest pose [Bn]: from its joint to every joint below it, as far as the next bone.
BoneSegments segments_of_bones(const Character& character, const std::vector<int>& bone_of_joint) {
  const auto rest = character.skeleton.pose(character.rest_dofs);
  BoneSegments segments(character.bone_joint.size());
  for (std::size_t b = 0; b < segments.size(); ++b) {
    const Vector3d position = rest[character.bone_joint[b]].translation();
    segments[b].push_back({position, position});
  }
  for (int j = 0; j < character.skeleton.num_joints(); ++j)
    if (const int bone = bone_above(character.skeleton, bone_of_joint, j); bone >= 0)
      segments[bone].push_back({segments[bone][0][0], rest[j].translation()});
  return segments;
}

double distance_to(const std::vector<std::array<Vector3d, 2>>& segments, const Vector3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [from, to] : segments) {
    const Vector3d along = to - from;
    const double length2 = along.squaredNorm();
    const double t = length2 > 0.0 ? std::clamp((point - from).dot(along) / length2, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, (point - from - t * along).norm());
  }
  return nearest;
}

/// [Bn][Bn] whether two bones are at most kSteps apart.
std::vector<std::vector<bool>> related_bones(const Character& character, const std::vector<int>& bone_of_joint) {
  const std::size_t n = character.bone_joint.size();
  std::vector<std::vector<bool>> adjacent(n, std::vector<bool>(n, false));
  for (std::size_t b = 0; b < n; ++b) {
    adjacent[b][b] = true;
    if (const int up = bone_above(character.skeleton, bone_of_joint, character.bone_joint[b]); up >= 0)
      adjacent[b][up] = adjacent[up][b] = true;
  }
  std::vector<std::vector<bool>> related = adjacent;
  for (int step = 1; step < kSteps; ++step) {
    const std::vector<std::vector<bool>> before = related;
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b)
        for (std::size_t c = 0; before[a][b] && c < n; ++c)
          if (adjacent[b][c]) related[a][c] = true;
  }
  return related;
}

/// The usual distance of each bone from the vertices that it moves most [Bn]; 0 for a bone without any.
std::vector<double> usual_distances(const Character& character, const BoneSegments& segments) {
  std::vector<std::vector<double>> distances(segments.size());
  for (int v = 0; v < character.num_vertices(); ++v) {
    const auto bone = as_size(character.skin.vertex_bones.row(v).front());
    distances[bone].push_back(distance_to(segments[bone], character.mesh.vertices[v]));
  }
  std::vector<double> usual;
  for (const std::vector<double>& of_bone : distances) usual.push_back(median(of_bone));
  return usual;
}

/// The distance within which a vertex could belong to each bone [Bn]; 0 for a bone that moves none most.
std::vector<double> reaches(const Character& character, const BoneSegments& segments,
                            const std::vector<int>& bone_of_joint) {
  std::vector<double> reach = usual_distances(character, segments);
  std::vector<bool> is_end(reach.size(), true);
  for (const int joint : character.bone_joint)
    if (const int bone = bone_above(character.skeleton, bone_of_joint, joint); bone >= 0) is_end[bone] = false;
  for (std::size_t b = 0; b < reach.size(); ++b) {
    if (reach[b] <= 0.0) continue;
    reach[b] *= kUsualReach;
    for (const auto& [from, to] : segments[b])
      if (is_end[b]) reach[b] = std::max(reach[b], kReachOfEnd * (to - from).norm());
  }
  return reach;
}

/// [N] the bones that each vertex could belong to, ascending.
IndexRows possible_owners(const Character& character, const BoneSegments& segments, const std::vector<double>& reach) {
  IndexRows owners;
  for (const Vector3d& vertex : character.mesh.vertices) {
    double nearest = std::numeric_limits<double>::infinity();
    std::vector<double> ratios;
    for (std::size_t b = 0; b < segments.size(); ++b) {
      ratios.push_back(reach[b] > 0.0 ? distance_to(segments[b], vertex) / reach[b]
                                      : std::numeric_limits<double>::infinity());
      nearest = std::min(nearest, ratios.back());
    }
    for (std::size_t b = 0; b < ratios.size(); ++b)
      if (ratios[b] <= std::max(nearest, 1.0) && reach[b] > 0.0) owners.items.push_back(static_cast<int>(b));
    owners.offsets.push_back(static_cast<int>(owners.items.size()));
  }
  return owners;
}

}  // namespace

StickingVertices::StickingVertices(const Character& character) : character_(character) {
  std::vector<int> bone_of_joint(character.skeleton.joints.size(), -1);
  for (std::size_t b = 0; b < character.bone_joint.size(); ++b)
    bone_of_joint[character.bone_joint[b]] = static_cast<int>(b);
  related_ = related_bones(character, bone_of_joint);
  const BoneSegments segments = segments_of_bones(character, bone_of_joint);
  owners_ = possible_owners(character, segments, reaches(character, segments, bone_of_joint));
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : character.mesh.vertices) box.extend(vertex);
  tolerance_ = kShareOfHeight * box.sizes().y();
}

/// Where a vertex would be with the weights of a bone and of its relatives alone.
Vector3d StickingVertices::position_by(const SkinBlend& blend, int vertex, int bone) const {
  constexpr double kMinSum = 1e-3;
  const auto all_bones = character_.skin.vertex_bones.row(vertex);
  const auto all_weights = character_.skin.vertex_bones.row_of(character_.skin.weights, vertex);
  std::vector<int> bones;
  std::vector<double> weights;
  double sum = 0.0;
  for (std::size_t i = 0; i < all_bones.size(); ++i) {
    if (!related_[bone][all_bones[i]]) continue;
    bones.push_back(all_bones[i]);
    weights.push_back(all_weights[i]);
    sum += all_weights[i];
  }
  const Vector3d& rest = character_.mesh.vertices[vertex];
  if (sum < kMinSum) return blend.motions()[bone] * rest;
  for (double& weight : weights) weight /= sum;
  return blend.point(rest, bones, weights);
}

std::vector<int> StickingVertices::find(const SkinBlend& blend, const std::vector<Vector3d>& posed) const {
  std::vector<int> result;
  for (int v = 0; v < character_.num_vertices(); ++v) {
    const auto owners = owners_.row(v);
    const bool follows = std::any_of(owners.begin(), owners.end(), [&](int bone) {
      return (position_by(blend, v, bone) - posed[v]).norm() <= tolerance_;
    });
    if (!follows) result.push_back(v);
  }
  return result;
}

}  // namespace doppel
