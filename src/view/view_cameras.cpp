#include "doppel/view/view_cameras.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {
namespace {

constexpr double kLongerSide = 1280.0;
const cv::Scalar kMaskColour(60, 220, 60);  // BGR

nlohmann::json matrix_rows(const Eigen::Matrix3d& m) {
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({m(r, 0), m(r, 1), m(r, 2)});
  return rows;
}

/// The mask half transparent over the image, with its outline.
void paint_mask(cv::Mat& image, const cv::Mat& mask) {
  cv::Mat tinted = image.clone();
  tinted.setTo(kMaskColour, mask);
  cv::addWeighted(tinted, 0.4, image, 0.6, 0.0, image);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(image, outlines, -1, kMaskColour, 2);
}

}  // namespace

struct ViewCameras::View {
  Camera camera;
  int file_index = 0;
  std::string source;
  Undistorter undistort;
  std::unique_ptr<FrameReader> images;
  std::unique_ptr<MaskSource> masks;
  long last_frame = 0, last_mask = 0;
};

ViewCameras::ViewCameras(const Capture& capture, const SequenceEntry& sequence)
    : capture_(capture), sequence_(sequence) {
  const CaptureCameras chosen = choose_cameras(capture);
  for (std::size_t c = 0; c < chosen.cameras.size(); ++c) {
    const Camera& calibrated = chosen.cameras[c];
    const int index = chosen.file_index[c];
    if (sequence.videos.empty() || !has_images(capture, sequence, calibrated, index)) continue;
    const std::string source = capture.source(sequence.videos, index, calibrated.name);
    std::unique_ptr<FrameReader> images = open_frames(source, PixelFormat::colour);
    const Camera camera = fit_to_images(calibrated, images->size(), source);
    views_.push_back(
        std::make_unique<View>(View{camera, index, source, Undistorter(camera), std::move(images), nullptr, 0, 0}));
  }
}

ViewCameras::~ViewCameras() = default;

CaptureCameras ViewCameras::filmed() const {
  CaptureCameras filmed;
  for (const auto& view : views_) {
    filmed.cameras.push_back(view->camera);
    filmed.file_index.push_back(view->file_index);
  }
  return filmed;
}

std::string ViewCameras::description() const {
  nlohmann::json cameras = nlohmann::json::array();
  for (const auto& view : views_) {
    const Camera& camera = view->camera;
    cameras.push_back({{"name", camera.name},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"K", matrix_rows(camera.K)},
                       {"R", matrix_rows(camera.R)},
                       {"t", {camera.t.x(), camera.t.y(), camera.t.z()}}});
  }
  return nlohmann::json{{"masks", has_masks()}, {"cameras", cameras}}.dump();
}

cv::Mat ViewCameras::read(View& view, long frame, bool mask) {
  if (frame < view.last_frame) view.images = open_frames(view.source, PixelFormat::colour);
  view.last_frame = frame;
  const cv::Mat filmed = view.images->read(frame);
  cv::Mat image = view.undistort.apply(filmed).clone();
  if (!mask) return image;
  // Masks computed from images need no order, and learning an empty scene takes long.
  if (!view.masks || (frame < view.last_mask && !view.masks->needs_image()))
    view.masks = std::make_unique<MaskSource>(capture_, sequence_, view.camera, view.file_index);
  view.last_mask = frame;
  paint_mask(image, view.masks->read(frame, filmed));
  return image;
}

std::string ViewCameras::image(int camera, long row, bool mask) {
  if (camera < 0 || as_size(camera) >= views_.size())
    fail<UsageError>("there is no camera {}; there are {}, counted from 0", camera, views_.size());
  if (mask && !has_masks()) fail<UsageError>("the sequence {} has no masks", sequence_.name);
  View& view = *views_[camera];
  const std::lock_guard lock(readers_);
  cv::Mat image = read(view, capture_.clock(sequence_, view.camera.name).frame(row), mask);
  const double scale = kLongerSide / std::max(image.cols, image.rows);
  if (scale < 1.0) cv::resize(image, image, {}, scale, scale, cv::INTER_AREA);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 85});
  return {bytes.begin(), bytes.end()};
}

}  // namespace doppel
