#include "doppel/actor/person_input.h"

#include "doppel/data/dataset/batch_builder.h"

namespace doppel {

void describe_keys(const Keys& keys, DetectionOptions& options) {
  keys("confidence_threshold", options.alignment.confidence_threshold, between(0.0, 1.0),
       "keypoints below do not count");
  options.loss.confidence_threshold = options.alignment.confidence_threshold;
}

LoaderOptions with_people(LoaderOptions options, int person_size) {
  options.past_frames = 0;
  options.keypoints = true;
  options.person_size = person_size;
  return options;
}

Batch person_batch(const Dataset& dataset, const std::vector<SampleId>& samples, const std::vector<int>& cameras,
                   int person_size) {
  BatchOptions options;
  options.past_frames = 0;
  options.keypoints = true;
  options.person_size = person_size;
  return make_batch(dataset, samples, std::vector<std::vector<int>>(samples.size(), cameras), options);
}

Batch person_batch(const Dataset& dataset, const SampleId& sample, const LoaderOptions& loader) {
  return person_batch(dataset, {sample}, dataset.camera_indices(loader.cameras), loader.person_size);
}

PersonView person_view(const Batch& batch) {
  const torch::Tensor row = torch::arange(batch.person_camera.size(0));
  return {batch.person.select(1, 0), batch.camera_rotation.index({row, batch.person_camera}),
          keypoint_rays(batch.keypoints, batch.camera_projection, batch.camera_position), torch::Tensor()};
}

KeypointTarget keypoint_target(const Batch& batch, const torch::Tensor& counts) {
  const torch::Tensor seen = batch.keypoints * counts.to(batch.keypoints.scalar_type()).view({-1, 1, 1, 1});
  return {seen, batch.camera_projection, batch.keypoint_scale};
}

}  // namespace doppel
