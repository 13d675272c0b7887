#pragma once

#include <torch/types.h>

namespace doppel {

struct ShadingOptions {
  bool lit = true;             ///< false: the albedo alone; `lighting` is then ignored
  bool nearest = false;        ///< the nearest texel instead of bilinear; no gradient through the UVs
  bool flip_normals = true;    ///< interpolated normals that face away from the camera are negated
  float z_near = 0.01f;        ///< metres; parts nearer to the camera plane are cut away
  bool use_reference = false;  ///< plain tensor operations instead of the kernel
};

/// The visible faces of a drawing, which `shade` returns for functions that need the same visibility. The format is
/// private to the kernel.
struct Fragments {
  torch::Tensor records;  ///< int32 [B*C, tiles, words]
  torch::Tensor counts;   ///< int32 [B*C, tiles]
  bool defined() const { return records.defined(); }
};

struct ShadedImage {
  torch::Tensor colour;  ///< [B,C,H,W,3], background 0; not clamped
  torch::Tensor mask;    ///< bool [B,C,H,W], true where the mesh is seen
  Fragments fragments;   ///< undefined when the reference ran
};

struct SupersampledImage {
  torch::Tensor image;  ///< float32 [B,C,H,W,channels], area average with background 0 (premultiplied by alpha)
  torch::Tensor alpha;  ///< float32 [B,C,H,W], the covered fraction of the pixel
  /// image + (1 - alpha) * background. @param background broadcasts with [B,C,H,W,channels]
  torch::Tensor over(const torch::Tensor& background) const;
};

struct TargetOptions {
  int radius = 1;  ///< of the derivative filter, pixels
  float z_near = 0.01f;
  bool use_reference = false;
};

}  // namespace doppel
