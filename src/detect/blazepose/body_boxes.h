#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace doppel {

/// A person as the detector network sees it. Pixels of the image; points may lie outside of it.
struct BodyBox {
  double score = 0.0;                                                                ///< probability of a person
  Eigen::Vector2d corner = Eigen::Vector2d::Zero(), size = Eigen::Vector2d::Zero();  ///< of the head and shoulders
  /// The middle of the hips, a point on the circle around it that holds the person; the same two for the upper body.
  std::array<Eigen::Vector2d, 4> keypoints;
};

inline constexpr int kDetectorPixels = 224;  ///< side of the detector's input
inline constexpr int kDetectorAnchors = 2254;
inline constexpr int kDetectorValues = 12;  ///< of an anchor: x, y, width and height of a box, x and y of 4 keypoints

/// The points relative to which the network states boxes, (0, 0) to (1, 1) over its input, in the order of its outputs:
/// two for each cell of 28 x 28, two for 14 x 14, six for 7 x 7, row by row.
std::vector<Eigen::Vector2d> detector_anchors();

/// Boxes in the detector's input, (0, 0) to (1, 1), with a score of at least 0.5.
/// @param values [2254, 12] in pixels of the input relative to the anchors
/// @param scores [2254] logits
std::vector<BodyBox> decode_boxes(std::span<const float> values, std::span<const float> scores);

/// One box per person, best first. Starting with the best box, all boxes whose overlap with it (intersection over
/// union) exceeds 0.3 are averaged, weighted by score, and taken out; the best box's score is kept.
std::vector<BodyBox> merge_boxes(std::vector<BodyBox> boxes);

/// A box of the letterboxed input, (0, 0) to (1, 1), in pixels of the image.
BodyBox box_in_image(const BodyBox& box, cv::Size image);

}  // namespace doppel
