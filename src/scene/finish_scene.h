#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "doppel/scene/scene.h"
#include "doppel/scene/scene_limits.h"

namespace doppel {

/// (joint, weight) pairs of one vertex, as a file has them.
using JointWeights = std::vector<std::pair<int, double>>;

/// Appends one row to the weights of a primitive: no zeros, one entry per joint, largest first, sum 1.
/// @return whether the sum was already 1 within 1e-3 @throws Error for a weight that is negative or not finite
bool append_weights(ScenePrimitive& primitive, JointWeights row);

/// What every reader does last: gives names, checks indices, numbers and the tree, sorts the primitives by node.
/// @throws FileError as read_scene
void finish_scene(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits);

/// A polygon as a fan of triangles from its first corner. @param corner called with three positions in the polygon
template <typename Emit>
void split_polygon(int corners, const Emit& emit) {
  for (int i = 2; i < corners; ++i) emit(0, i - 1, i);
}

/// An 8-bit BGR image from the bytes of an image file; empty when they are none, or larger than the limit.
cv::Mat decode_image(const void* data, std::size_t size, int largest_side);

/// The image file that a surface names: as it is written, else by its name alone in the folder of the scene and in
/// folders beside it. Empty when there is none. Slashes of both kinds and `%20` are understood.
std::filesystem::path find_image(const std::filesystem::path& scene_file, std::string name);

/// Linear intensity 0..1 as the sRGB value of images.
double srgb(double linear);

}  // namespace doppel
