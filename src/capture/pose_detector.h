#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/keypoints/keypoints.h"

namespace doppel {

/// A network that computes one heatmap per point from an image (OpenPose's body models, or any other of that form), and
/// the preprocessing of its input.
struct PoseDetectorOptions {
  std::filesystem::path model;    ///< .onnx, or the .prototxt of a Caffe model
  std::filesystem::path weights;  ///< .caffemodel of a .prototxt; empty for .onnx
  int input_height = 368;         ///< of the network's input; the width follows from the image, both multiples of 8
  double scale = 1.0 / 255.0;     ///< value = (colour - mean) * scale
  std::vector<double> mean{0.0, 0.0, 0.0};  ///< in the order of the network's channels, 0..255
  bool rgb = false;                         ///< the network expects RGB; OpenPose's models expect BGR
  double threshold = 0.1;                   ///< points with lower heatmap values are not seen
};

/// Finds one person's points. Not thread-safe.
class PoseDetector {
 public:
  /// @param layout the network's output must have a channel for each point of the layout, in the same order; further
  /// channels (background, limbs) are ignored
  /// @throws FileError when the model cannot be read, UsageError for invalid options
  PoseDetector(const PoseDetectorOptions& options, const PointLayout& layout);
  ~PoseDetector();
  PoseDetector(const PoseDetector&) = delete;
  PoseDetector& operator=(const PoseDetector&) = delete;
  PoseDetector(PoseDetector&&) noexcept;
  PoseDetector& operator=(PoseDetector&&) noexcept;

  /// The position of the largest value of each heatmap, refined to subpixel accuracy by a parabola through the
  /// neighbours; the value there is the confidence. One person is assumed.
  /// @param image 8-bit BGR
  /// @return no person when no point is seen; pixels of the image, first pixel centre at (0.5, 0.5)
  /// @throws Error when the network cannot run on the image, or its output is not of the form [1, >= n, h, w]
  People detect(const cv::Mat& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
