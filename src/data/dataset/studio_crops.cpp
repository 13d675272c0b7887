#include "doppel/data/dataset/studio_crops.h"

#include <opencv2/imgproc.hpp>

#include "doppel/detect/masks/mask.h"

namespace doppel {

namespace {
constexpr std::size_t kMaxBytes = 1'000'000'000;
}

cv::Mat background_crop(const cv::Mat& studio, const CropBox& box, int pixels) {
  cv::Mat result = cv::Mat::zeros(pixels, pixels, CV_8UC3);
  if (!studio.empty() && !box.empty()) cv::cvtColor(crop_image(studio, box, pixels), result, cv::COLOR_BGR2RGB);
  return result;
}

cv::Mat StudioCrops::studio(int camera) {
  const auto known = studios_.find(camera);
  if (known != studios_.end()) return known->second;
  cv::Mat image = dataset_.background(camera);
  const std::size_t bytes = image.total() * image.elemSize();
  if (bytes_ + bytes <= kMaxBytes) {
    bytes_ += bytes;
    studios_[camera] = image;
  }
  return image;
}

void StudioCrops::check(const std::vector<int>& cameras) {
  for (const int camera : cameras) studio(camera);
}

torch::Tensor StudioCrops::of(const Batch& batch) {
  const auto B = batch.image.size(0), C = batch.image.size(1), I = batch.image.size(2);
  torch::Tensor crops = torch::empty({B, C, I, I, 3});
  for (std::int64_t b = 0; b < B; ++b) {
    const SampleId sample{batch.sequence[b].item<int>(), batch.frames[b].item<int>()};
    for (std::int64_t c = 0; c < C; ++c) {
      const int camera = batch.cameras[b][c].item<int>();
      const cv::Mat crop = background_crop(studio(camera), dataset_.crop_box(sample, camera), static_cast<int>(I));
      crops[b][c].copy_(torch::from_blob(crop.data, {I, I, 3}, torch::kUInt8));
    }
  }
  return crops / 255.0;
}

}  // namespace doppel
