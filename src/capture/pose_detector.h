#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/capture/keypoints.h"

namespace doppel {

/// A network that turns an image into a heatmap per point (OpenPose's body models, or any other of that form), and how
/// its input is made.
struct PoseDetectorOptions {
  std::filesystem::path model;    ///< .onnx, or the .prototxt of a Caffe model
  std::filesystem::path weights;  ///< .caffemodel of a .prototxt; empty for .onnx
  int input_height = 368;         ///< of the network's input; its width follows from the image, both multiples of 8
  double scale = 1.0 / 255.0;     ///< value = (colour - mean) * scale
  std::vector<double> mean{0.0, 0.0, 0.0};  ///< in the order of the network's channels, 0..255
  bool rgb = false;                         ///< the network wants red first; OpenPose's want blue first
  double threshold = 0.1;                   ///< lower heatmap values are not seen
};

/// Finds one person's points. Not thread-safe.
class PoseDetector {
 public:
  /// @param layout the network's output must have a channel for each of its points, in its order; further channels
  ///        (background, limbs) are left alone
  /// @throws FileError when the model cannot be read, UsageError for options that make no sense
  PoseDetector(const PoseDetectorOptions& options, const PointLayout& layout);
  ~PoseDetector();
  PoseDetector(PoseDetector&&) noexcept;
  PoseDetector& operator=(PoseDetector&&) noexcept;

  /// Where each heatmap is largest, refined below its grid by a parabola through the neighbours; the value there is the
  /// confidence. One person is assumed.
  /// @param image 8-bit BGR @return nobody when no point is seen; pixels of the image, first centre at (0.5, 0.5)
  /// @throws Error when the network cannot run on the image, or gives another form than [1, >= n, h, w]
  People detect(const cv::Mat& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
