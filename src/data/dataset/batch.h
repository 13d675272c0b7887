#pragma once

#include <torch/types.h>

namespace doppel {

/// The input of one training step: B samples with C cameras each, that is, B*C views.
///
/// The crop of a view has S x S pixels, where S is the side of the masks in the store. "Crop pixels" below are pixels
/// of this crop, with (0, 0) at its upper left corner and pixel centres at +0.5. Where a view has no crop, because its
/// mask is empty, the projections of crops are those of the whole image. All tensors are on the CPU.
struct Batch {
  torch::Tensor frames;    ///< int64 [B] frame of the sample: a row of its sequence's motion
  torch::Tensor sequence;  ///< int64 [B] index into Dataset::sequences()
  torch::Tensor dofs;     ///< float32 [B,F+1,D] motion windows, the rows frame-F .. frame, oldest first; undefined when
                          ///< none of the samples' sequences has a motion
  torch::Tensor cameras;  ///< int64 [B,C] index into Dataset::cameras()
  torch::Tensor projection;  ///< float32 [B,C,3,4] crop pixels from world metres
  torch::Tensor distance;  ///< float32 [B,C,S,S] distance field: signed distance to the outline, crop pixels, negative
                           ///< inside the mask; 0 where not valid
  torch::Tensor pixel_scale;      ///< float32 [B,C] pixels of the camera's image per crop pixel; 1 where not valid
  torch::Tensor valid;            ///< bool [B,C] false where the mask is empty or fills the crop: there is no outline
  torch::Tensor contour;          ///< float32 [Q,2] centres (x, y) of the contour pixels of all views, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1] the rows of `contour` that belong to view i = sample * C + camera
                                  ///< are contour_offsets[i] .. contour_offsets[i+1] - 1

  // Images, if BatchOptions::images is set; otherwise undefined. They show the same crop at I x I pixels, so their
  // pixels differ from the crop pixels above.
  torch::Tensor image;       ///< uint8 [B,C,I,I,3] RGB; black beyond the camera's image, and where the mask is empty
  torch::Tensor image_mask;  ///< uint8 [B,C,I,I] 1 = person, 0 = background; 0 beyond the camera's image
  torch::Tensor image_projection;  ///< float32 [B,C,3,4] pixels of `image` from world metres

  // Keypoints and cameras of the whole images, if BatchOptions::keypoints is set; otherwise undefined. M is the number
  // of landmarks, in the order of Dataset::landmarks(). Pixels are those of the whole image without lens distortion.
  torch::Tensor keypoints;          ///< float32 [B,C,M,3] x, y, confidence 0..1; 0, 0, 0 where not seen
  torch::Tensor keypoint_scale;     ///< float32 [B,C] reference pixels per pixel: 1024 / width of the camera's image
  torch::Tensor camera_projection;  ///< float32 [B,C,3,4] pixels of the whole image from world metres
  torch::Tensor camera_rotation;    ///< float32 [B,C,3,3] camera from world
  torch::Tensor camera_position;    ///< float32 [B,C,3] camera centre, world metres

  // The image of the person that is the input of PoseNet or DefNet (person_crop.h), if BatchOptions::person_size is
  // set; otherwise undefined. It shows each sample in one camera, so P = 1. With `augment`, this camera is drawn at
  // random from those that see the person. Without `augment`, it is the first of them. R = BatchOptions::person_size.
  torch::Tensor person;             ///< float32 [B,P,3,R,R] (RGB 0..1 - mean) / deviation, with the mean and standard
                                    ///< deviation of ImageNet; the background is black before this
  torch::Tensor person_camera;      ///< int64 [B] the chosen camera: index among the C cameras of the sample
  torch::Tensor person_projection;  ///< float32 [B,P,3,4] pixels of `person` from world metres
  torch::Tensor person_valid;       ///< bool [B] false where no camera sees the person: `person` is all background
};

/// The contents of a batch.
struct BatchOptions {
  int past_frames = 2;     ///< F: past frames in the motion window
  bool images = false;     ///< also load images
  int image_size = 0;      ///< I, at most as stored; 0: as stored
  bool keypoints = false;  ///< also load keypoints and the cameras of the whole images; the dataset must have landmarks
  int person_size = 0;     ///< R, side of `person` in pixels; 0: `person` is not loaded
  bool augment = false;    ///< choose the camera, colours and window of `person` at random
};

}  // namespace doppel
