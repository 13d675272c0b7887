#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/networks/person_network.h"

namespace doppel {

/// Finds one person's keypoints with a network (detect/networks/person_network.h), in the images of one camera in their
/// order. Not thread-safe.
class PoseDetector {
 public:
  /// @param layout the network must find the points of the layout, in the same order
  /// @throws as PersonNetwork
  PoseDetector(const PersonNetworkOptions& options, const PointLayout& layout);

  /// The points of one person, and the mask where the options name a network for it.
  /// @param image 8-bit BGR
  /// @return no person when no point is seen; pixels of the image, first pixel centre at (0.5, 0.5)
  /// @throws Error when the network cannot run on the image, or does not find the points of the layout
  People detect(const cv::Mat& image);
  /// The mask in the image of the last `detect`, probability * 255; empty without a network for it, or without a
  /// person.
  const cv::Mat& mask() const { return mask_; }

 private:
  PersonNetwork network_;
  std::filesystem::path model_;
  cv::Mat mask_;
};

}  // namespace doppel
