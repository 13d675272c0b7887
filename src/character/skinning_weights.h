#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// How the transforms of a vertex's bones are blended. Equations: layers/skinning/skinning.h
enum class SkinningMode { dual_quaternion = 0, linear = 1 };

/// Sparse skinning weights: (bone, weight) pairs for each of N vertices, largest first. The weights of a vertex sum to
/// 1. The first bone of a vertex fixes the signs of dual quaternions.
struct SkinningWeights {
  std::vector<std::string> bones;  ///< [Bn]
  IndexRows vertex_bones;          ///< [N] rows of bone indices
  std::vector<double> weights;     ///< aligned with vertex_bones.items
  bool repaired = false;           ///< the file had glued vertex indices, which were stripped

  int num_vertices() const { return vertex_bones.num_rows(); }
  int num_bones() const { return static_cast<int>(bones.size()); }
};

/// Reads "Skeletool character skinning file V1.0" and its glued variant. Weights are renormalised.
/// @param num_vertices the template's N, or 0 to use the number in the file
/// @throws FileError: header, bone index, weight outside [0,1], sum off by more than 1e-3, missing vertices
SkinningWeights read_skin(const std::filesystem::path& path, int num_vertices = 0);
void write_skin(const std::filesystem::path& path, const SkinningWeights& weights);

}  // namespace doppel
