#pragma once

#include <cstdint>

namespace doppel::kernels {

/// A mesh in one view.
struct RasterView {
  const float* vertices = nullptr;      ///< [N,3]
  float matrix[12] = {};                ///< row-major [3,4]: (u w, v w, w) from (x,1); w = depth in metres
  const std::int32_t* faces = nullptr;  ///< [F,4] vertex indices, the fourth unused
  float* screen = nullptr;              ///< [N,4]: u, v, 1/w, w; 1/w = 0 marks a vertex that must be cut
  int width = 0, height = 0;
  float z_near = 0;
  int cull = 0;
};

}  // namespace doppel::kernels
