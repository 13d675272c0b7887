#pragma once

#include <torch/types.h>

namespace doppel {

/// The input of one training step: B samples (a sequence and a frame) with C cameras each, in crop pixels. S is the
/// side of the masks in the store.
struct Batch {
  torch::Tensor frames;           ///< int64 [B] row in the motion of its sequence
  torch::Tensor sequence;         ///< int64 [B] index into Dataset::sequences()
  torch::Tensor dofs;             ///< float32 [B,F+1,D] motion rows frame-F .. frame, oldest first; undefined when no
                                  ///< sample's sequence has a motion
  torch::Tensor cameras;          ///< int64 [B,C] index into Dataset::cameras()
  torch::Tensor projection;       ///< float32 [B,C,3,4] crop pixels from world metres
  torch::Tensor distance;         ///< float32 [B,C,S,S] signed distance to the outline, crop pixels, + outside
  torch::Tensor pixel_scale;      ///< float32 [B,C] image pixels per crop pixel
  torch::Tensor valid;            ///< bool [B,C] false where the camera does not see the person
  torch::Tensor contour;          ///< float32 [P,2] centres (x, y) of the contour pixels, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1] rows of `contour` per (sample, camera)

  // Images, if BatchOptions::images is set; otherwise undefined. I is the side of the images. Their pixels are not the
  // crop pixels of the masks above.
  torch::Tensor image;             ///< uint8 [B,C,I,I,3] RGB; black beyond the camera's image or without one
  torch::Tensor image_mask;        ///< uint8 [B,C,I,I] 1 = person; 0 beyond the camera's image
  torch::Tensor image_projection;  ///< float32 [B,C,3,4] pixels of `image` from world metres

  // Keypoints, if BatchOptions::keypoints is set; otherwise undefined. M landmarks in the order of
  // Dataset::landmarks(), in pixels of the whole image without lens distortion.
  torch::Tensor keypoints;          ///< float32 [B,C,M,3] x, y, confidence 0..1; 0, 0, 0 where not seen
  torch::Tensor keypoint_scale;     ///< float32 [B,C] 1024 / width of the camera's image
  torch::Tensor camera_projection;  ///< float32 [B,C,3,4] pixels of the whole image from world metres
  torch::Tensor camera_rotation;    ///< float32 [B,C,3,3] camera from world
  torch::Tensor camera_position;    ///< float32 [B,C,3] world metres

  // The network's image of the person, if BatchOptions::person_size is set; otherwise undefined. P = 1 camera of each
  // sample, drawn at random from those that see the person (with `augment` off, the first of them). See person_crop.h.
  torch::Tensor person;             ///< float32 [B,P,3,S,S] RGB minus ImageNet's mean over its deviation, on black
  torch::Tensor person_camera;      ///< int64 [B] index of this camera among the C cameras
  torch::Tensor person_projection;  ///< float32 [B,P,3,4] pixels of `person` from world metres
  torch::Tensor person_valid;       ///< bool [B] false where no camera sees the person: `person` is black then
};

/// The contents of a batch.
struct BatchOptions {
  int past_frames = 2;  ///< F: past frames in the motion window
  bool images = false;  ///< also load images
  int image_size = 0;   ///< I; 0: as stored, otherwise at most as stored
  bool keypoints = false;
  int person_size = 0;   ///< S of `person`; 0: none
  bool augment = false;  ///< vary camera, colours and window of `person` at random
};

}  // namespace doppel
