#pragma once

// Depth and barycentrics of finished pixels. For kernel files only. The functions are static, because the files that
// include this header are compiled with different rounding rules and must not share code.

#include "doppel/render/raster/raster_view.h"
#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {

struct Pixels {
  Float b[3], z;
};

/// A pixel of a face with corners behind the camera, which have no screen position. Solves for the intersection of the
/// face's plane with the pixel's ray, p = M x homogeneous, b = M^-1 (u, v, 1).
static inline void resolve_cut_pixel(const RasterView& view, std::int32_t face, double u, double v, float* b,
                                     float& z) {
  double h[3][3];
  for (int k = 0; k < 3; ++k) {
    const float* x = view.vertices + 3 * static_cast<std::int64_t>(view.faces[4 * static_cast<std::int64_t>(face) + k]);
    for (int r = 0; r < 3; ++r) {
      const float* m = view.matrix + 4 * r;
      h[k][r] =
          static_cast<double>(m[0]) * x[0] + static_cast<double>(m[1]) * x[1] + static_cast<double>(m[2]) * x[2] + m[3];
    }
    h[k][0] -= u * h[k][2];  // the pixel becomes the origin
    h[k][1] -= v * h[k][2];
  }
  double g[3], sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double* p = h[(k + 1) % 3];
    const double* q = h[(k + 2) % 3];
    g[k] = p[0] * q[1] - p[1] * q[0];
    sum += g[k];
  }
  double total = 0;
  for (double& value : g) {
    value = sum < 0 ? -value : value;
    value = value > 0 ? value : 0;
    total += value;
  }
  double depth = 0;
  for (int k = 0; k < 3; ++k) {
    const double value = total > 0 ? g[k] / total : 1.0 / 3;
    b[k] = static_cast<float>(value);
    depth += value * h[k][2];
  }
  z = static_cast<float>(depth > view.z_near ? depth : view.z_near);
}

/// @param corner receives the vertices of the faces; those of face 0 where a pixel has no face
static inline Pixels resolve_pixels(const RasterView& view, const std::int32_t* faces, Float centre_u, Float centre_v,
                                    std::int32_t (*corner)[kLanes]) {
  alignas(64) std::int32_t present[kLanes];
  store(present, max(load<Int>(faces), Int{}));
  load_corners(view.faces, present, corner);
  Float u[3], v[3], iz[3], w[3];
  for (int k = 0; k < 3; ++k) {
    load_records(view.screen, corner[k], u[k], v[k], iz[k], w[k]);
    u[k] -= centre_u;
    v[k] -= centre_v;
  }
  // Unrounded corners: rounding decides which pixels are drawn, not their positions on the face. A pixel that only the
  // rounded triangle covers is moved to the edge.
  Float s[3];
  for (int k = 0; k < 3; ++k) {
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    s[k] = u[a] * v[b] - u[b] * v[a];
  }
  const Int turned = s[0] + s[1] + s[2] < 0;
  Float total = {};
  for (int k = 0; k < 3; ++k) {
    s[k] = turned ? -s[k] : s[k];
    s[k] = max(s[k], Float{}) * iz[k];
    total += s[k];
  }
  const Int solid = total > 0;
  const Float scale = 1.0f / (solid ? total : splat(3.0f));
  Pixels p;
  for (int k = 0; k < 3; ++k) p.b[k] = (solid ? s[k] : splat(1.0f)) * scale;
  p.z = p.b[0] * w[0] + p.b[1] * w[1] + p.b[2] * w[2];

  const unsigned cut = bits_of(mask_of((iz[0] <= 0) | (iz[1] <= 0) | (iz[2] <= 0)));
  for (unsigned left = cut; left != 0; left &= left - 1) {
    const int lane = __builtin_ctz(left);
    if (faces[lane] < 0) continue;
    float b[3], z;
    resolve_cut_pixel(view, faces[lane], centre_u[lane], centre_v[lane], b, z);
    for (int k = 0; k < 3; ++k) p.b[k][lane] = b[k];
    p.z[lane] = z;
  }
  return p;
}

}  // namespace doppel::kernels::DOPPEL_ISA
