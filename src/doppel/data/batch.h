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

  // Pictures, when asked for (BatchOptions::images); else undefined. I is the side of the pictures, their pixels are
  // not those of the masks above.
  torch::Tensor image;             ///< uint8 [B,C,I,I,3] RGB; black beyond the camera's picture and where none is
  torch::Tensor image_mask;        ///< uint8 [B,C,I,I] 1 = person; 0 beyond the camera's picture
  torch::Tensor image_projection;  ///< float32 [B,C,3,4] pixels of `image` from world metres
};

/// What a batch is to hold.
struct BatchOptions {
  int window = 2;       ///< F: earlier frames in the DoF window
  bool images = false;  ///< pictures too
  int image_size = 0;   ///< I; 0: as stored, else at most that
};

}  // namespace doppel
