#pragma once

#include <opencv2/core.hpp>
#include <opencv2/video/background_segm.hpp>
#include <vector>

namespace doppel {

/// A mixture of Gaussians for each pixel of the empty scene (MOG2), in tiles. A tile is asked only where the image
/// differs from the empty scene. A pixel that is as near to the mean of its learnt colours as the smallest variance
/// allows matches the scene in any case, and single pixels beyond are the sensor's noise.
class TiledMixtures {
 public:
  TiledMixtures() = default;
  /// @param threshold, shadow as in BackgroundOptions
  TiledMixtures(double threshold, double shadow, cv::Size size);

  /// @param image 8-bit BGR @param rate share of the image in the model, 0..1
  void learn(const cv::Mat& image, double rate);
  /// The mean of the learnt colours, 8-bit BGR.
  cv::Mat empty_scene() const;
  /// 0 background, 127 shadow, 255 person, without learning. @param empty `empty_scene`
  cv::Mat classes(const cv::Mat& image, const cv::Mat& empty) const;

 private:
  struct Tile {
    cv::Rect box;
    cv::Ptr<cv::BackgroundSubtractorMOG2> model;
  };
  cv::Mat far_from(const cv::Mat& image, const cv::Mat& empty) const;

  cv::Size size_;
  std::vector<Tile> tiles_;
  int sure_ = 0;  ///< squared distance of a colour that surely matches
};

}  // namespace doppel
