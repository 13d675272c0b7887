#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/track/energy/outline.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/fit/tracked_frame.h"
#include "doppel/track/footage.h"

namespace doppel {

/// A contact sheet of fits: a row per frame, a column per camera (at most four, spread over the rig). Green: the mask's
/// outline; red: vertices on the outline of the fitted surface; yellow: landmarks; blue: keypoints.
class TrackSheet {
 public:
  TrackSheet(const std::vector<PinholeCamera>& cameras, const PoseModel& model);
  void add(long frame, const FootageFrame& seen, const TrackedFrame& found);
  bool empty() const { return rows_.empty(); }
  /// 8-bit BGR
  cv::Mat image() const;

 private:
  const std::vector<PinholeCamera>& cameras_;
  const PoseModel& model_;
  OutlineFinder outlines_;
  std::vector<int> shown_;
  std::vector<cv::Mat> rows_;
};

}  // namespace doppel
