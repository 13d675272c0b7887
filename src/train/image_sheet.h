#pragma once

#include <torch/torch.h>

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/dataset.h"
#include "doppel/render/shading/shading.h"

namespace doppel {

/// A contact sheet of drawings beside the photographs they should equal: a row per frame, from another camera each,
/// with the photograph first, then each drawing and its error.
class ImageSheet {
 public:
  /// @param image_size side of the images that batches hold; 0: as stored
  ImageSheet(const Dataset& dataset, int image_size) : dataset_(dataset), image_size_(image_size) {}

  /// One frame as the next camera in turn sees it: B = C = 1, with images.
  Batch batch(const SampleId& sample, int past_frames);
  /// @param batch what `batch` returned @param drawings of the same view, each [1,1,I,I,3]
  void add(const Batch& batch, const std::vector<ShadedImage>& drawings);

  bool empty() const { return rows_.empty(); }
  /// 8-bit BGR; empty when nothing was added. Errors are mean absolute differences of the channels where both drawing
  /// and mask are, from black (none) over red to white (a quarter of the range or more).
  cv::Mat image() const;

 private:
  const Dataset& dataset_;
  int image_size_;
  std::size_t turn_ = 0;
  std::vector<cv::Mat> rows_;
};

}  // namespace doppel
