#pragma once

#include <tiny_gltf.h>
#include <torch/types.h>

#include <cstdint>
#include <string>

#include "doppel/io/figure_export/glb_buffer.h"
#include "doppel/render/splats/splats.h"

namespace doppel {

inline constexpr const char* kSplatExtension = "KHR_gaussian_splatting";

/// The M Gaussians that go into a file.
struct WrittenSplats {
  torch::Tensor positions;   ///< [M,3]
  torch::Tensor normals;     ///< [M,3] zeros when there are none
  torch::Tensor rotations;   ///< [M,4] w x y z, of length 1
  torch::Tensor log_scales;  ///< [M,3]
  torch::Tensor opacities;   ///< [M,1] logits
  torch::Tensor harmonics;   ///< [M,S,3]
  torch::Tensor index;       ///< int64 [M] which of the N Gaussians they are, ascending
};

/// Checks shapes and types, and that there is such a batch item. @param action begins the messages
/// @throws UsageError
void check_written(const std::string& action, const Splats& splats, std::int64_t item);

/// The Gaussians of a batch item that can be written: all values finite, the quaternion longer than 0.
/// @param action begins the message @throws Error when there is none
WrittenSplats written_splats(const std::string& action, const Splats& splats, std::int64_t item);

/// Points with the attributes and the object of KHR_gaussian_splatting, and COLOR_0 (splat_file.h).
tinygltf::Primitive splat_primitive(GlbBuffer& buffer, const WrittenSplats& splats);

}  // namespace doppel
