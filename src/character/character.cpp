#include "doppel/character/character.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include "doppel/core/error.h"
#include "doppel/core/statistics.h"

namespace doppel {

namespace {

/// 64-bit FNV-1a over the bytes of integers and words.
class Digest {
 public:
  void add(std::int64_t value) {
    for (int byte = 0; byte < 8; ++byte)
      mix(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * byte)));
  }
  void add(std::string_view word) {
    add(static_cast<std::int64_t>(word.size()));
    for (const char c : word) mix(static_cast<std::uint8_t>(c));
  }
  void add(const std::vector<int>& values) {
    add(static_cast<std::int64_t>(values.size()));
    for (const int value : values) add(static_cast<std::int64_t>(value));
  }
  template <std::size_t n>
  void add(const std::vector<std::array<int, n>>& rows) {
    add(static_cast<std::int64_t>(rows.size()));
    for (const auto& row : rows)
      for (const int value : row) add(static_cast<std::int64_t>(value));
  }
  /// Weights are rounded to 1e-6, so that a character copied through files of another machine has the same digest.
  void add_weights(const std::vector<double>& values) {
    add(static_cast<std::int64_t>(values.size()));
    for (const double value : values) add(static_cast<std::int64_t>(std::llround(value * 1e6)));
  }
  std::string text() const { return fmt::format("{:016x}", hash_); }

 private:
  void mix(std::uint8_t byte) { hash_ = (hash_ ^ byte) * 1099511628211ULL; }
  std::uint64_t hash_ = 14695981039346656037ULL;
};

}  // namespace

std::string Character::fingerprint() const {
  Digest digest;
  digest.add(static_cast<std::int64_t>(num_vertices()));
  digest.add(mesh.faces);
  for (const std::string& bone : skin.bones) digest.add(bone);
  digest.add(skin.vertex_bones.offsets);
  digest.add(skin.vertex_bones.items);
  digest.add_weights(skin.weights);
  digest.add(bone_joint);
  digest.add(graph.node_vertex);
  digest.add(graph.edges);
  digest.add(graph.vertex_nodes.offsets);
  digest.add(graph.vertex_nodes.items);
  digest.add_weights(graph.weights);
  for (const Dof& dof : skeleton.dofs) digest.add(dof.name);
  // Nothing is added by default, so that digests of earlier versions hold.
  if (skinning == SkinningMode::linear) digest.add(std::string("linear"));
  return digest.text();
}

void complete_character(Character& character) {
  const int n = character.num_vertices();
  if (character.skin.num_vertices() != n)
    fail("the skin of character '{}' has {} vertices but its mesh has {}", character.name,
         character.skin.num_vertices(), n);
  if (character.rest_dofs.empty()) character.rest_dofs.assign(character.num_dofs(), 0.0);
  if (static_cast<int>(character.rest_dofs.size()) != character.num_dofs())
    fail("the rest pose of character '{}' has {} values but its skeleton {} DoFs", character.name,
         character.rest_dofs.size(), character.num_dofs());
  character.bone_joint.clear();
  for (const std::string& bone : character.skin.bones)
    character.bone_joint.push_back(character.skeleton.joint_of_bone(bone, character.options.bone_rule));
  character.rigidity = vertex_rigidity(character.labels, n, character.options.rigidity);
}

namespace {

/// The median distance of points to the nearest vertex of the template; 0 without points.
double median_distance(const std::vector<Eigen::Vector3d>& points, const TriangleMesh& mesh) {
  if (points.empty()) return 0.0;
  std::vector<double> distances;
  for (const Eigen::Vector3d& position : points) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& vertex : mesh.vertices)
      smallest = std::min(smallest, (vertex - position).squaredNorm());
    distances.push_back(std::sqrt(smallest));
  }
  return median(std::move(distances));
}

double marker_distance(const Skeleton& skeleton, const std::vector<double>& rest_dofs, const TriangleMesh& mesh) {
  const auto world_from_joint = skeleton.pose(rest_dofs);
  std::vector<Eigen::Vector3d> points;
  for (const Marker& marker : skeleton.markers) points.push_back(world_from_joint[marker.joint] * marker.position);
  return median_distance(points, mesh);
}

}  // namespace

double skeleton_distance(const Character& character) {
  const auto world_from_joint = character.skeleton.pose(character.rest_dofs);
  std::vector<Eigen::Vector3d> points;
  for (const int joint : character.bone_joint) points.emplace_back(world_from_joint[joint].translation());
  return median_distance(points, character.mesh);
}

MarkerDistances decide_marker_reading(Skeleton& skeleton, const std::vector<double>& rest_dofs,
                                      const TriangleMesh& mesh) {
  MarkerDistances found;
  if (skeleton.markers.empty() || mesh.vertices.empty()) return found;
  Skeleton relative = skeleton, world = skeleton;
  // Both candidates start from the numbers of the file: the positions are converted back before the other reading.
  for (std::size_t m = 0; m < skeleton.markers.size(); ++m) {
    const Eigen::Vector3d written = marker_to_file(skeleton, skeleton.markers[m], skeleton.marker_reading);
    relative.markers[m].position = world.markers[m].position = written;
  }
  relative.marker_reading = world.marker_reading = MarkerReading::joint_relative;
  reread_markers(world, MarkerReading::zero_pose_world);
  found.joint_relative = marker_distance(relative, rest_dofs, mesh);
  found.zero_pose_world = marker_distance(world, rest_dofs, mesh);
  skeleton = found.zero_pose_world < found.joint_relative ? std::move(world) : std::move(relative);
  return found;
}

}  // namespace doppel
