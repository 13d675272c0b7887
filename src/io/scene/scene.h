#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// What a file of a surface or of a rigged figure says, in the file's own coordinates and unit. Indices point into the
/// vectors of the `Scene`. A reader checks every index, so code that takes a Scene need not.

/// A node of the tree. Its transform to its parent is
///   Trans(translation) * before * Rot(rotation) * between * Scale(scale) * after.
/// The three constant transforms are the identity in most files. FBX has pivots and pre-rotations there, and a node
/// that a file gives as a matrix has the matrix in `after`. Animations replace translation, rotation and scale.
struct SceneNode {
  std::string name;  ///< unique in the scene and never empty; `node_7` where the file has none
  int parent = -1;   ///< any index, also a larger one; without cycles
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Affine3d before = Eigen::Affine3d::Identity();
  Eigen::Affine3d between = Eigen::Affine3d::Identity();
  Eigen::Affine3d after = Eigen::Affine3d::Identity();
};

/// Base colour and texture of a surface.
struct SceneMaterial {
  std::string name;
  Eigen::Vector4d colour = Eigen::Vector4d::Ones();  ///< RGB and opacity, 0..1, multiplies the texture
  cv::Mat texture;                                   ///< 8-bit BGR, or empty
  std::string texture_file{};                        ///< as the scene names it; empty for an image inside of the scene
};

/// A part of the surface with one material, placed by one node. A mesh that several nodes use appears once per node.
struct ScenePrimitive {
  int node = 0;
  int index = 0;                          ///< of the primitive in its mesh
  std::string name;                       ///< of the mesh, may be empty
  int material = -1;                      ///< -1: none
  std::vector<int> face_materials;        ///< [F] where the triangles differ in material, else empty
  int skin = -1;                          ///< -1: the primitive follows its node
  std::vector<Eigen::Vector3d> vertices;  ///< [N] in the node's frame, or in the skin's
  std::vector<Triangle> faces;            ///< [F] with the order of corners that is right in the world, at rest
  std::vector<Eigen::Vector2d> uvs;       ///< [U] u right, v up, as in TriangleMesh; or empty
  std::vector<Triangle> face_uvs;         ///< [F] the UV of each corner, or empty
  std::vector<Eigen::Vector3d> colours;   ///< [N] RGB 0..1, or empty
  /// [N] rows of indices into the skin's joints, empty without a skin. A vertex with an empty row follows the node.
  IndexRows vertex_joints;
  std::vector<double> weights;  ///< aligned with vertex_joints.items; each row sums to 1

  int num_vertices() const { return static_cast<int>(vertices.size()); }
};

/// The joints that move a skinned surface: x' = sum_j w_j * world_from_node(joint_j) * joint_from_mesh_j * x.
struct SceneSkin {
  std::string name;
  std::vector<int> joints;                        ///< nodes
  std::vector<Eigen::Affine3d> joint_from_mesh;   ///< [joints] inverse bind matrices
  std::optional<Eigen::Affine3d> bind_transform;  ///< world from mesh when it was bound, where the file says so
};

/// How one value of one node changes over time.
struct SceneChannel {
  enum class Target { translation, rotation, scale };
  enum class Interpolation { linear, step, cubic };
  int node = 0;
  Target target = Target::translation;
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times;  ///< [K] seconds, ascending
  /// [K], or [3 K] for `cubic`: in-tangent, value, out-tangent of each key, as in glTF. Rotations are (x, y, z, w),
  /// others (x, y, z, 0).
  std::vector<Eigen::Vector4d> values;
};

struct SceneAnimation {
  std::string name;  ///< unique in the scene and never empty; `animation_0` where the file has none
  std::vector<SceneChannel> channels;
  double start = 0.0;  ///< time of the first key, seconds
  double end = 0.0;    ///< time of the last key, seconds
  /// Times of the file's own keys, ascending, where a reader gave the channels more (curves of FBX); else empty.
  std::vector<double> keys;
};

struct Scene {
  std::vector<SceneNode> nodes;
  std::vector<ScenePrimitive> primitives;  ///< in the order of their nodes, then of the primitives in the mesh
  std::vector<SceneMaterial> materials;
  std::vector<SceneSkin> skins;
  std::vector<SceneAnimation> animations;
  std::optional<double> metres_per_unit;  ///< where the file or its format says so
  std::optional<char> up;                 ///< 'x', 'y' or 'z', where the file or its format says so
  std::vector<std::string> warnings;      ///< what was repaired or left out, one sentence each

  int num_vertices() const;
  int num_faces() const;
};

/// World transforms of all nodes without animation, [nodes].
std::vector<Eigen::Affine3d> node_transforms(const Scene& scene);
/// As above at one time of an animation. Before its first and after its last key a channel keeps its value.
/// @param seconds on the time axis of the file
std::vector<Eigen::Affine3d> node_transforms(const Scene& scene, const SceneAnimation& animation, double seconds);

/// The texture of a material times its colour; empty without a texture. It may share memory with the material.
cv::Mat coloured_texture(const SceneMaterial& material);

/// The vertices of one primitive in the world, by linear blend skinning or by its node, [N].
/// @param world_from_node [nodes]
std::vector<Eigen::Vector3d> posed_vertices(const Scene& scene, const ScenePrimitive& primitive,
                                            const std::vector<Eigen::Affine3d>& world_from_node);
/// The vertices of all primitives, one after the other.
std::vector<Eigen::Vector3d> posed_vertices(const Scene& scene, const std::vector<Eigen::Affine3d>& world_from_node);

}  // namespace doppel
