#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "doppel/io/scene/scene.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel {

/// (joint, weight) pairs of one vertex, as a file has them.
using JointWeights = std::vector<std::pair<int, double>>;

/// Appends one row to the weights of a primitive: no zeros, one entry per joint, largest first, sum 1.
/// @return whether the sum was already 1 within 1e-3 @throws Error for a weight that is negative or not finite
bool append_weights(ScenePrimitive& primitive, JointWeights row);

/// @throws FileError for a parent that is no node, or for nodes in a circle
void check_tree(const std::filesystem::path& path, const std::vector<SceneNode>& nodes);

/// Gives the faces whose UVs are {-1, -1, -1} one UV of their own, (0, 0).
void complete_face_uvs(ScenePrimitive& primitive);

/// Keeps `face_materials` only where the faces differ, and sets `material` to that of the first face.
void single_material(ScenePrimitive& primitive);

/// What every reader does last: gives names, checks indices, numbers and the tree, sorts the primitives by node, and
/// turns the triangles over that mirroring nodes or joints have turned inside out.
/// @throws FileError as read_scene
void finish_scene(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits);

/// A polygon as a fan of triangles from its first corner. @param emit called with three positions in the polygon
template <typename Emit>
void split_polygon(int corners, const Emit& emit) {
  for (int i = 2; i < corners; ++i) emit(0, i - 1, i);
}

}  // namespace doppel
