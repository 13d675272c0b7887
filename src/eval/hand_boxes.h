#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// Where the hands are in the views of a capture: squares of 24 cm around the knuckle of each middle finger, by the
/// poses of the capture and the markers `left_middle_finger1` and `right_middle_finger1`.
class HandBoxes {
 public:
  /// @param skeleton of the capture's character
  HandBoxes(const Dataset& dataset, const Skeleton& skeleton);

  /// Whether the character has the markers.
  bool known() const { return knuckles_.size() == 2; }
  /// The squares of both hands, cut off at the border of the image. A hand that is behind the camera, or whose square
  /// lies outside of the image, is left out. None where the pose of the frame is unknown.
  /// @param camera index of the dataset @pre known
  std::vector<cv::Rect> find(const SampleId& sample, int camera) const;

 private:
  const Dataset& dataset_;
  Skeleton skeleton_;
  std::vector<Marker> knuckles_;  ///< of both hands, as far as the character has them
};

}  // namespace doppel
