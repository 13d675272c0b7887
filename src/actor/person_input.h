#pragma once

#include <vector>

#include "doppel/core/options.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/losses/keypoints.h"
#include "doppel/nets/pose_capture.h"

namespace doppel {

/// Which keypoints count as detections. Shared by the global alignment and the losses.
struct DetectionOptions {
  GlobalAlignmentOptions alignment;
  KeypointLossOptions loss;
};
/// The keys in a section `loss`.
void describe_keys(const Keys& keys, DetectionOptions& options);

/// The loader's options with images of the person, `person_size` pixels wide, and keypoints; without past frames.
LoaderOptions with_people(LoaderOptions options, int person_size);

/// Samples as input of PoseNet and DefNet in evaluation, without random changes. The image is that of the first camera
/// that sees the person.
/// @param cameras whose keypoints the batch contains
Batch person_batch(const Dataset& dataset, const std::vector<SampleId>& samples, const std::vector<int>& cameras,
                   int person_size);
/// A sample in the cameras that a loader draws from.
Batch person_batch(const Dataset& dataset, const SampleId& sample, const LoaderOptions& options);

/// The images of the batch, and the rays of its keypoints in all of its cameras.
PersonView person_view(const Batch& batch);
/// The batch's keypoints as input of the losses. @param counts bool [B]: samples whose keypoints count
KeypointTarget keypoint_target(const Batch& batch, const torch::Tensor& counts);

}  // namespace doppel
