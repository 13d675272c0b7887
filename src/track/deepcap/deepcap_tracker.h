#pragma once

#include <vector>

#include "doppel/actor/trained_pose.h"
#include "doppel/data/dataset/person_crop.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/fit/tracked_frame.h"

namespace doppel {

/// Tracks frames of one camera by trained networks (chapter 5), each frame independently.
class DeepcapTracker {
 public:
  /// @param trained must outlive the tracker
  /// @param landmarks of the keypoints, in their order
  /// @throws Error when the landmarks lack one that the run was trained with
  DeepcapTracker(TrainedPose& trained, const PinholeCamera& camera, const std::vector<Marker>& landmarks);

  /// @param image BGR, without distortion @param mask without distortion
  /// @return pose and graph; the frame is lost where the keypoints do not determine the position
  FrameResult capture(const cv::Mat& image, const cv::Mat& mask, const std::vector<Keypoint>& keypoints);
  /// The deformed surface. @param graph [K*6] @return float32 [N,3] world metres
  torch::Tensor surface(const std::vector<double>& dofs, const std::vector<double>& graph) const;

  const PoseModel& model() const { return model_; }

 private:
  PersonView view_of(const PersonInput& input, const std::vector<Keypoint>& keypoints) const;

  TrainedPose& trained_;
  PinholeCamera camera_;
  PoseModel model_;
  std::vector<int> source_;  ///< [M of the run] index into the landmarks of the capture
};

}  // namespace doppel
