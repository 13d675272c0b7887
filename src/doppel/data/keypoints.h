#pragma once

#include <filesystem>
#include <vector>

namespace doppel {

/// A detected 2D landmark in pixels (first pixel's centre at 0.5 or as the detector wrote it; no shift is applied).
struct Keypoint {
  float x = 0.0f, y = 0.0f;
  float confidence = 0.0f;  ///< 0..1; 0: not seen
};

/// Reads OpenPose's `*_keypoints.json` (`people[].pose_keypoints_2d`; BODY_25 or COCO by its length). Of several people
/// the one with the largest sum of confidences is taken; without people all confidences are 0.
/// @param num_points what a file without people yields (25: BODY_25, 18: COCO), and what others must have; 0: any
/// @throws FileError: no JSON, another structure, a number of values that is not 3 per point, not finite
std::vector<Keypoint> read_openpose(const std::filesystem::path& path, int num_points = 25);

}  // namespace doppel
