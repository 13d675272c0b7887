#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "doppel/character/character.h"

/// A small actor built in code, in milliseconds, with everything that makes real ones awkward: a capped bent tube
/// around a chain of joints; a root `tx ty tz ry rz rx` whose weights are not 1; a joint driven by two DoFs, a DoF that
/// drives two joints, one that drives none; a sliding joint; a rest pose that is not zero; 1-4 sorted skin weights per
/// vertex.
namespace doppel {

namespace test_character {

/// Numbers in [-1, 1] that are the same on every machine.
class Noise {
 public:
  explicit Noise(unsigned seed) : generator_(seed) {}
  double next() { return 2.0 * (static_cast<double>(generator_()) / 4294967295.0) - 1.0; }

 private:
  std::mt19937 generator_;
};

constexpr double kSegment = 0.3;  ///< length of one bone, metres
constexpr double kRadius = 0.08;

/// A length that survives the way through a file in millimetres to the last digit.
inline double snap(double metres) { return std::round(metres * 1e6) / 1e3 * 0.001; }
inline Eigen::Vector3d snap(const Eigen::Vector3d& v) { return {snap(v.x()), snap(v.y()), snap(v.z())}; }

inline int add_joint(Skeleton& skeleton, const std::string& name, Joint::Type type, int parent,
                     const Eigen::Vector3d& offset, const Eigen::Vector3d& axis) {
  const bool slides = type == Joint::Type::prismatic;
  skeleton.joints.push_back({name, type, parent, snap(offset), slides ? Eigen::Vector3d(axis * 0.001) : axis});
  return skeleton.num_joints() - 1;
}

inline std::string segment(int i) { return "Seg" + std::to_string(i); }

inline void add_joints(Skeleton& skeleton, int num_joints, Noise& noise) {
  using V = Eigen::Vector3d;
  const auto slide = Joint::Type::prismatic, turn = Joint::Type::revolute;
  int last = add_joint(skeleton, "Root_tx", slide, -1, V(0.0, 0.4, 0.07), V::UnitX());
  last = add_joint(skeleton, "Root_ty", slide, last, V::Zero(), V::UnitY());
  last = add_joint(skeleton, "Root_tz", slide, last, V::Zero(), V::UnitZ());
  last = add_joint(skeleton, "Root_ry", turn, last, V::Zero(), V::UnitY());
  last = add_joint(skeleton, "Root_rz", turn, last, V::Zero(), V::UnitZ());
  last = add_joint(skeleton, "Root_rx", turn, last, V::Zero(), V::UnitX());
  for (int i = 1; i < num_joints; ++i) {
    const V offset(0.02 * noise.next(), kSegment, 0.02 * noise.next());
    last = i == 1 ? add_joint(skeleton, segment(i) + "_ty", slide, last, offset, -V::UnitY())
                  : add_joint(skeleton, segment(i) + "_ry", turn, last, offset, V::UnitY());
    last = add_joint(skeleton, segment(i) + "_rz", turn, last, V::Zero(), V::UnitZ());
    last = add_joint(skeleton, segment(i) + "_rx", turn, last, V::Zero(), V::UnitX());
  }
}

inline void add_dofs(Skeleton& skeleton, int num_joints) {
  const auto joint = [&](const std::string& name) { return *skeleton.find_joint(name); };
  const auto add = [&](const std::string& name, std::vector<Dof::Drive> drives,
                       std::optional<std::array<double, 2>> limits = std::nullopt) {
    skeleton.dofs.push_back({name, std::move(drives), limits});
  };
  for (const char* axis : {"x", "y", "z"})
    add(std::string("translate_") + axis, {{joint(std::string("Root_t") + axis), 1000.0}});
  for (const char* axis : {"y", "z", "x"})
    add(std::string("rotate_") + axis, {{joint(std::string("Root_r") + axis), 3.0}});
  // One DoF bends two joints, and both have one of their own below.
  if (num_joints > 2) add("bend", {{joint("Seg1_rz"), 0.6}, {joint("Seg2_rz"), -0.4}}, {{-1.2, 1.2}});
  add("idle", {});
  for (int i = 1; i < num_joints; ++i) {
    add("lean_" + std::to_string(i), {{joint(segment(i) + "_rz"), 1.0}}, {{-0.8, 0.9}});
    add("flex_" + std::to_string(i), {{joint(segment(i) + "_rx"), 0.7}});
    if (i == 1) add("stretch", {{joint("Seg1_ty"), 100.0}}, {{-0.1, 0.1}});
    if (i > 1) add("twist_" + std::to_string(i), {{joint(segment(i) + "_ry"), 1.5}}, {{-0.5, 0.5}});
  }
}

inline void add_markers(Skeleton& skeleton) {
  for (int j = 5; j < skeleton.num_joints(); j += 3)
    skeleton.markers.push_back(
        {"mark_" + skeleton.joints[j].name, j, snap(Eigen::Vector3d(0.05, 0.1, 0.02)), snap(0.015)});
}

/// The joint whose frame carries segment i (0 is the root).
inline int segment_joint(int i) { return 5 + 3 * i; }

/// A capped tube of `rings` x `around` vertices; ring r lies `height(r)` along the chain, ends are single vertices.
inline TriangleMesh make_tube(const std::vector<Eigen::Affine3d>& world_from_joint, int num_joints, int around,
                              int rings) {
  TriangleMesh mesh;
  const double length = kSegment * num_joints;
  const auto position = [&](double s, double radius, double angle) {
    const int i = std::clamp(static_cast<int>(s / kSegment), 0, num_joints - 1);
    const Eigen::Vector3d local(radius * std::cos(angle), s - i * kSegment, 0.8 * radius * std::sin(angle));
    mesh.vertices.push_back(snap(world_from_joint[segment_joint(i)] * local));
  };
  for (int r = 0; r < rings; ++r)
    for (int a = 0; a < around; ++a)
      position(length * (r + 0.5) / rings, kRadius * (1.0 + 0.2 * std::sin(1.0 * r)), 2.0 * M_PI * a / around);
  position(0.0, 0.0, 0.0);
  position(length, 0.0, 0.0);

  // UVs: a strip with a seam, so that corners of one vertex differ.
  for (int r = 0; r < rings; ++r)
    for (int a = 0; a <= around; ++a) mesh.uvs.emplace_back(static_cast<double>(a) / around, (r + 1.0) / (rings + 1.0));
  mesh.uvs.emplace_back(0.5, 0.0);
  mesh.uvs.emplace_back(0.5, 1.0);

  const int bottom = rings * around, uv_bottom = rings * (around + 1);
  const auto v = [&](int r, int a) { return r * around + a % around; };
  const auto t = [&](int r, int a) { return r * (around + 1) + a; };
  const auto add = [&](Triangle face, Triangle uv) {
    mesh.faces.push_back(face);
    mesh.face_uvs.push_back(uv);
  };
  for (int a = 0; a < around; ++a) {
    add({bottom, v(0, a), v(0, a + 1)}, {uv_bottom, t(0, a), t(0, a + 1)});
    for (int r = 0; r + 1 < rings; ++r) {
      add({v(r, a), v(r + 1, a), v(r + 1, a + 1)}, {t(r, a), t(r + 1, a), t(r + 1, a + 1)});
      add({v(r, a), v(r + 1, a + 1), v(r, a + 1)}, {t(r, a), t(r + 1, a + 1), t(r, a + 1)});
    }
    const int top = rings - 1;
    add({bottom + 1, v(top, a + 1), v(top, a)}, {uv_bottom + 1, t(top, a + 1), t(top, a)});
  }
  return mesh;
}

/// How far along the chain a vertex of make_tube lies, in bones.
inline double height_of(int vertex, int num_joints, int around, int rings) {
  if (vertex >= rings * around) return vertex == rings * around ? 0.0 : num_joints;
  return num_joints * (vertex / around + 0.5) / rings;
}

inline SkinningWeights make_skin(int num_vertices, int num_joints, int around, int rings, Noise& noise) {
  SkinningWeights skin;
  skin.bones.push_back("Root");
  for (int i = 1; i < num_joints; ++i) skin.bones.push_back(segment(i));
  for (int v = 0; v < num_vertices; ++v) {
    std::vector<double> weight(num_joints);
    for (int b = 0; b < num_joints; ++b) {
      const double d = height_of(v, num_joints, around, rings) - (b + 0.5) + 0.05 * noise.next();
      weight[b] = std::exp(-2.0 * d * d);
    }
    std::vector<int> order(num_joints);
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return std::pair(-weight[a], a) < std::pair(-weight[b], b); });
    order.resize(std::min(num_joints, 1 + v % 4));
    double sum = 0.0;
    for (const int b : order) sum += weight[b];
    for (const int b : order) {
      skin.vertex_bones.items.push_back(b);
      skin.weights.push_back(weight[b] / sum);
    }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  return skin;
}

inline std::vector<double> make_rest_pose(const Skeleton& skeleton, Noise& noise) {
  std::vector<double> rest(skeleton.num_dofs());
  for (double& value : rest) value = 0.06 * noise.next();
  for (int i = 0; i < 3; ++i) rest[i] = (i == 1 ? 0.5 : 0.2) + 0.2 * noise.next();
  return rest;
}

inline std::vector<int> make_labels(int num_vertices, int num_joints, int around, int rings) {
  const int by_height[] = {18, 16, 9, 5, 14, 13, 2};
  std::vector<int> labels(num_vertices);
  for (int v = 0; v < num_vertices; ++v) {
    const double share = height_of(v, num_joints, around, rings) / num_joints;
    labels[v] = by_height[std::min(6, static_cast<int>(7.0 * share))];
  }
  return labels;
}

}  // namespace test_character

/// @param num_joints bones of the chain, at least 2; the skeleton has 6 + 3 * (num_joints - 1) joint entries
/// @param vertices_around, rings the tube has vertices_around * rings + 2 vertices (at least 3 and 2)
inline Character make_test_character(int num_joints = 5, int vertices_around = 8, int rings = 20, unsigned seed = 1) {
  namespace tc = test_character;
  tc::Noise noise(seed);
  Character character;
  character.name = "tube";
  tc::add_joints(character.skeleton, num_joints, noise);
  tc::add_dofs(character.skeleton, num_joints);
  tc::add_markers(character.skeleton);
  character.rest_dofs = tc::make_rest_pose(character.skeleton, noise);
  const auto world_from_joint = character.skeleton.pose(character.rest_dofs);
  character.mesh = tc::make_tube(world_from_joint, num_joints, vertices_around, rings);
  character.skin = tc::make_skin(character.num_vertices(), num_joints, vertices_around, rings, noise);
  character.labels = tc::make_labels(character.num_vertices(), num_joints, vertices_around, rings);
  const TriangleMesh coarse =
      tc::make_tube(world_from_joint, num_joints, std::max(3, vertices_around / 2), std::max(2, rings / 2));
  character.graph = build_graph(character.mesh, coarse, character.options.graph);
  complete_character(character);
  return character;
}

/// The default one, made once.
inline const Character& test_actor() {
  static const Character character = make_test_character();
  return character;
}

}  // namespace doppel
