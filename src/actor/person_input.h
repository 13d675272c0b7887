#pragma once

#include <vector>

#include "doppel/core/config.h"
#include "doppel/data/loader.h"
#include "doppel/losses/keypoints.h"
#include "doppel/nets/pose_capture.h"

namespace doppel {

/// What counts as a detection, in the alignment and in the losses alike.
struct DetectionOptions {
  GlobalAlignmentOptions alignment;
  KeypointLossOptions loss;

  /// Keys `confidence_threshold` and `binary_alignment` of a section `loss`.
  static DetectionOptions read(const ConfigReader& loss);
};

/// The loader's options with images of people, `person_size` pixels wide, and keypoints; without a motion window.
LoaderOptions with_people(LoaderOptions options, int person_size);

/// Frames as PoseNet and DefNet see them in evaluation: nothing is drawn at random, the image is that of the first of
/// the cameras in which the person is seen.
/// @param cameras whose keypoints come along
Batch person_batch(const Dataset& dataset, const std::vector<SampleId>& samples, const std::vector<int>& cameras,
                   int person_size);
/// A frame in the cameras that a loader draws from.
Batch person_batch(const Dataset& dataset, const SampleId& sample, const LoaderOptions& options);

/// What the batch shows of each person, and the rays of its keypoints in all of its cameras.
PersonView person_view(const Batch& batch);
/// The batch's keypoints as the losses take them. @param counts bool [B]: people whose keypoints count at all
KeypointTarget keypoint_target(const Batch& batch, const torch::Tensor& counts);

}  // namespace doppel
