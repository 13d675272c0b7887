#pragma once

#include <torch/types.h>

#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/dataset/batch.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// A crop of an image of the empty studio, RGB; black for an empty image or box.
/// @param studio BGR, see Dataset::background
cv::Mat background_crop(const cv::Mat& studio, const CropBox& box, int pixels);

/// The empty studio in the crops of batches. Keeps the images of cameras that it has read, as many as fit into 1 GB;
/// others are read for each crop.
class StudioCrops {
 public:
  /// @param dataset must outlive this object
  explicit StudioCrops(const Dataset& dataset) : dataset_(dataset) {}

  /// Whether the capture has images of the empty studio.
  bool exist() const { return !dataset_.capture().background.empty(); }
  /// Reads the images of cameras once. @throws Error as Dataset::background, for the first that cannot be used
  void check(const std::vector<int>& cameras);
  /// @pre `exist` and the batch has images @return float32 [B,C,I,I,3] RGB 0..1, the crops of Batch::image
  /// @throws Error as Dataset::background
  torch::Tensor of(const Batch& batch);

 private:
  cv::Mat studio(int camera);

  const Dataset& dataset_;
  std::map<int, cv::Mat> studios_;  ///< by camera
  std::size_t bytes_ = 0;
};

}  // namespace doppel
