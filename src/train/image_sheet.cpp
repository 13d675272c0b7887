#include "doppel/train/image_sheet.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/losses/images.h"

namespace doppel {

namespace {

constexpr int kSheetCell = 256;     // pixels
constexpr double kWhiteError = 64;  // of 255

/// RGB 0..1 [I,I,3] as an 8-bit BGR image of a cell's size.
cv::Mat to_cell(const torch::Tensor& colour) {
  const torch::Tensor bytes = (colour.flip({2}).clamp(0, 1) * 255).round().to(torch::kUInt8).contiguous();
  cv::Mat cell;
  cv::resize(image_view(bytes), cell, {kSheetCell, kSheetCell}, 0, 0, cv::INTER_AREA);
  return cell;
}

cv::Mat error_cell(const torch::Tensor& drawing, const torch::Tensor& photograph, const torch::Tensor& where) {
  const torch::Tensor error = (drawing.clamp(0, 1) - photograph).abs().mean(2) * where * (255 / kWhiteError);
  const torch::Tensor grey = error.clamp(0, 1).unsqueeze(2).expand({-1, -1, 3});
  cv::Mat cell;
  cv::applyColorMap(to_cell(grey), cell, cv::COLORMAP_HOT);
  return cell;
}

}  // namespace

Batch ImageSheet::batch(const SampleId& sample, int past_frames) {
  const std::size_t count = dataset_.cameras().size();
  int camera = static_cast<int>(turn_ % count);
  // Skips cameras that do not see the person.
  for (std::size_t tried = 0; tried < count && dataset_.crop_box(sample, camera).empty(); ++tried)
    camera = static_cast<int>(++turn_ % count);
  turn_ += count > 2 ? count / 2 + 1 : 1;
  BatchOptions options;
  options.past_frames = past_frames;
  options.images = true;
  options.image_size = image_size_;
  return make_batch(dataset_, {sample}, {{camera}}, options);
}

void ImageSheet::add(const Batch& batch, const std::vector<ShadedImage>& drawings) {
  const torch::Tensor photograph = image_float(batch.image)[0][0];
  const torch::Tensor mask = batch.image_mask[0][0] > 0;
  std::vector<cv::Mat> cells{to_cell(photograph)};
  for (const ShadedImage& drawing : drawings) {
    const torch::Tensor colour = drawing.colour.detach()[0][0], seen = drawing.mask[0][0];
    cells.push_back(to_cell(colour));
    cells.push_back(error_cell(colour, photograph, seen & mask));
  }
  const auto sequence = as_size(batch.sequence[0].item<std::int64_t>());
  const std::string label =
      fmt::format("{} {}, camera {}", dataset_.sequences()[sequence].name, batch.frames[0].item<std::int64_t>(),
                  dataset_.camera(static_cast<int>(batch.cameras[0][0].item<std::int64_t>())).name);
  cv::putText(cells[0], label, {6, kSheetCell - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.4, {255, 255, 255}, 1, cv::LINE_AA);
  cv::Mat row;
  cv::hconcat(cells, row);
  rows_.push_back(row);
}

cv::Mat ImageSheet::image() const {
  cv::Mat sheet;
  if (!rows_.empty()) cv::vconcat(rows_, sheet);
  return sheet;
}

}  // namespace doppel
