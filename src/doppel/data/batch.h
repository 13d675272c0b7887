#pragma once

#include <torch/torch.h>

namespace doppel {

/// What training sees at once: B samples (a frame of a sequence) with C cameras each, in crop pixels. S is the side
/// of the masks in the store.
struct Batch {
  torch::Tensor frames;           ///< int64 [B] row in the motion of its sequence
  torch::Tensor sequence;         ///< int64 [B] index into Dataset::sequences()
  torch::Tensor dofs;             ///< float32 [B,F+1,D] motion rows frame-F .. frame, oldest first
  torch::Tensor cameras;          ///< int64 [B,C] index into Dataset::cameras()
  torch::Tensor projection;       ///< float32 [B,C,3,4] crop pixels from world metres
  torch::Tensor distance;         ///< float32 [B,C,S,S] signed distance to the outline, crop pixels, + outside
  torch::Tensor pixel_scale;      ///< float32 [B,C] image pixels per crop pixel
  torch::Tensor valid;            ///< bool [B,C] false where the camera sees nothing of the person
  torch::Tensor contour;          ///< float32 [P,2] centres (x, y) of the outline's pixels, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1] rows of `contour` per (sample, camera)
};

}  // namespace doppel
