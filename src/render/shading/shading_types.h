#pragma once

#include <torch/types.h>

namespace doppel {

struct ShadingOptions {
  bool lit = true;             ///< false: the albedo alone; `lighting` is then ignored
  bool nearest = false;        ///< the texel under the point instead of four; no gradient through the UVs then
  bool flip_normals = true;    ///< interpolated normals that face away from the camera are turned towards it
  float z_near = 0.01f;        ///< metres: what lies nearer to the camera plane is cut away
  bool use_reference = false;  ///< plain tensor operations instead of the kernel
};

/// What was seen where; handed from `shade` to functions that need the same visibility. Opaque, of the kernel's form.
struct Fragments {
  torch::Tensor records;  ///< int32 [B*C, tiles, words]
  torch::Tensor counts;   ///< int32 [B*C, tiles]
  bool defined() const { return records.defined(); }
};

struct ShadedImage {
  torch::Tensor colour;  ///< [B,C,H,W,3], background 0; not clamped
  torch::Tensor mask;    ///< bool [B,C,H,W], true where the mesh is seen
  Fragments fragments;   ///< undefined when the reference was taken
};

struct TargetOptions {
  int radius = 1;  ///< pixels of the derivative filter to each side
  float z_near = 0.01f;
  bool use_reference = false;
};

}  // namespace doppel
