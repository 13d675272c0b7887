#include "doppel/train/overlay.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "doppel/render/projection.h"

namespace doppel {

namespace {

constexpr int kOverlayCell = 280;  // pixels
constexpr int kMaxColumns = 4;

void draw_outline(cv::Mat& image, const cv::Mat& mask, const cv::Scalar& colour) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(image, contours, -1, colour, 1, cv::LINE_8);
}

}  // namespace

OverlaySheet::OverlaySheet(const Dataset& dataset, const torch::Tensor& faces) : dataset_(dataset), rasterizer_(faces) {
  const int available = static_cast<int>(dataset.cameras().size());
  const int columns = std::min(available, kMaxColumns);
  for (int i = 0; i < columns; ++i) cameras_.push_back(i * available / columns);
}

cv::Mat OverlaySheet::cell(const SampleId& sample, int camera, const torch::Tensor& before,
                           const torch::Tensor& after) {
  cv::Mat image(kOverlayCell, kOverlayCell, CV_8UC3, cv::Scalar(40, 40, 40));
  const CropBox box = dataset_.crop_box(sample, camera);
  if (!box.empty()) {
    const cv::Mat crop = dataset_.crop_image(sample, camera);
    if (!crop.empty()) cv::resize(crop, image, image.size(), 0, 0, cv::INTER_AREA);
    cv::Mat mask;
    cv::resize(dataset_.crop_mask(sample, camera), mask, image.size(), 0, 0, cv::INTER_NEAREST);
    draw_outline(image, mask, cv::Scalar(80, 220, 80));
    const torch::Tensor projection =
        projection_tensor({crop_camera(dataset_.camera(camera), box, kOverlayCell)}).unsqueeze(0);
    const auto draw = [&](const torch::Tensor& vertices, const cv::Scalar& colour) {
      const torch::Tensor covered =
          rasterizer_.coverage_projected(vertices.unsqueeze(0).contiguous(), projection, kOverlayCell, kOverlayCell)
              .contiguous();
      draw_outline(image, cv::Mat(kOverlayCell, kOverlayCell, CV_8UC1, covered.data_ptr<std::uint8_t>()), colour);
    };
    draw(before, cv::Scalar(255, 160, 60));
    draw(after, cv::Scalar(60, 60, 255));
  }
  const std::string label = fmt::format("{} {}, camera {}", dataset_.sequences()[sample.sequence].name, sample.frame,
                                        dataset_.camera(camera).name);
  cv::putText(image, label, cv::Point(6, kOverlayCell - 8), cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar(255, 255, 255), 1,
              cv::LINE_AA);
  return image;
}

void OverlaySheet::add(const SampleId& sample, const torch::Tensor& before, const torch::Tensor& after) {
  std::vector<cv::Mat> cells;
  for (int camera : cameras_) cells.push_back(cell(sample, camera, before, after));
  if (cells.empty()) return;
  cv::Mat row;
  cv::hconcat(cells, row);
  rows_.push_back(row);
}

cv::Mat OverlaySheet::image() const {
  cv::Mat sheet;
  if (!rows_.empty()) cv::vconcat(rows_, sheet);
  return sheet;
}

}  // namespace doppel
