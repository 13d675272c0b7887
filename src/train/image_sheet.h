#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/dataset/dataset.h"
#include "doppel/render/shading/shading.h"

namespace doppel {

/// A contact sheet that compares drawn with filmed images: a row per frame, each from another camera, with the filmed
/// image first, then each drawn image and its error.
class ImageSheet {
 public:
  /// @param image_size side of the images that batches hold; 0: as stored
  ImageSheet(const Dataset& dataset, int image_size) : dataset_(dataset), image_size_(image_size) {}

  /// A batch of one frame in the next camera in turn: B = C = 1, with images.
  Batch batch(const SampleId& sample, int past_frames);
  /// @param batch the result of `batch` @param drawings images of the same view, each [1,1,I,I,3]
  void add(const Batch& batch, const std::vector<ShadedImage>& drawings);

  bool empty() const { return rows_.empty(); }
  /// 8-bit BGR; empty when nothing was added. Errors are mean absolute differences of the channels where drawn image
  /// and mask overlap, from black (none) over red to white (a quarter of the range or more).
  cv::Mat image() const;

 private:
  const Dataset& dataset_;
  int image_size_;
  std::size_t turn_ = 0;
  std::vector<cv::Mat> rows_;
};

}  // namespace doppel
