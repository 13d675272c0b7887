#pragma once

#include <cmath>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/rigging/joints/body_skeleton.h"

namespace doppel::support {

constexpr int kTubeCorners = 32;  ///< of a ring

/// A closed cylinder along x. Ring i holds the vertices from i * kTubeCorners; the middles of the ends come last.
inline TriangleMesh cylinder(double from, double to, double radius,
                             const Eigen::Vector3d& centre = Eigen::Vector3d::Zero(), double step = 0.01) {
  TriangleMesh mesh;
  const int rings = static_cast<int>(std::lround((to - from) / step)) + 1;
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < kTubeCorners; ++k) {
      const double angle = 2 * M_PI * k / kTubeCorners;
      mesh.vertices.push_back(centre +
                              Eigen::Vector3d(from + i * step, radius * std::cos(angle), radius * std::sin(angle)));
    }
  for (int i = 0; i + 1 < rings; ++i)
    for (int k = 0; k < kTubeCorners; ++k) {
      const int a = i * kTubeCorners + k, b = i * kTubeCorners + (k + 1) % kTubeCorners, c = a + kTubeCorners,
                d = b + kTubeCorners;
      mesh.faces.push_back({a, b, d});
      mesh.faces.push_back({a, d, c});
    }
  for (const bool end : {false, true}) {
    const int middle = mesh.num_vertices(), ring = end ? (rings - 1) * kTubeCorners : 0;
    mesh.vertices.push_back(centre + Eigen::Vector3d(end ? to : from, 0, 0));
    for (int k = 0; k < kTubeCorners; ++k) {
      const int a = ring + k, b = ring + (k + 1) % kTubeCorners;
      mesh.faces.push_back(end ? Triangle{middle, a, b} : Triangle{middle, b, a});
    }
  }
  return mesh;
}

inline double area_of_ring(double radius) {
  return 0.5 * kTubeCorners * radius * radius * std::sin(2 * M_PI / kTubeCorners);
}

/// The skeleton of a body with a cylinder of its own around each segment of each bone, which only this bone moves.
/// In every pose all triangles move rigidly.
inline Character tube_body(const BodyJoints& joints, double radius = 0.03) {
  Character character;
  character.name = "tubes";
  const BodySkeleton body = make_body_skeleton(joints);
  character.skeleton = body.skeleton;
  character.rest_dofs = body.rest_dofs;
  for (const HeatBone& bone : heat_bones(joints)) {
    const int index = character.skin.num_bones();
    character.skin.bones.push_back(bone.name);
    for (const auto& [from, to] : bone.segments) {
      const double length = (to - from).norm();
      const TriangleMesh tube = cylinder(0, length, radius, Eigen::Vector3d::Zero(), length / 8);
      const auto turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), to - from);
      const int first = character.num_vertices();
      for (const Eigen::Vector3d& p : tube.vertices) {
        character.mesh.vertices.push_back(from + turn * p);
        character.skin.vertex_bones.items.push_back(index);
        character.skin.vertex_bones.offsets.push_back(character.num_vertices());
        character.skin.weights.push_back(1.0);
      }
      for (const Triangle& f : tube.faces) character.mesh.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
    }
  }
  complete_character(character);
  return character;
}

/// The signed volume of a closed mesh.
inline double volume(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& faces) {
  double sum = 0;
  for (const Triangle& f : faces) sum += vertices[f[0]].dot(vertices[f[1]].cross(vertices[f[2]])) / 6;
  return sum;
}

}  // namespace doppel::support
