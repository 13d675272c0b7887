#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/dataset/dataset.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

/// A contact sheet that compares outlines: a row per frame, a column per camera (at most four, spread over the rig).
class OverlaySheet {
 public:
  /// @param faces int32 [F,3]
  OverlaySheet(const Dataset& dataset, const torch::Tensor& faces);
  /// @param before, after float32 [N,3] world metres
  void add(const SampleId& sample, const torch::Tensor& before, const torch::Tensor& after);
  /// 8-bit BGR; empty when nothing was added.
  cv::Mat image() const;

 private:
  cv::Mat cell(const SampleId& sample, int camera, const torch::Tensor& before, const torch::Tensor& after);
  const Dataset& dataset_;
  Rasterizer rasterizer_;
  std::vector<int> cameras_;
  std::vector<cv::Mat> rows_;
};

}  // namespace doppel
