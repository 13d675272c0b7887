#pragma once

#include <cstdint>

namespace doppel {

/// Bounds of what a reader accepts, so that a damaged file cannot take all memory.
struct SceneLimits {
  std::int64_t vertices = 60'000'000;
  std::int64_t triangles = 60'000'000;
  int nodes = 100'000;
  int keys = 20'000'000;  ///< of all animations
  int image_side = 16384;
  bool surface_needed = true;  ///< refuse a file without triangles, such as one that holds an animation alone
};

}  // namespace doppel
