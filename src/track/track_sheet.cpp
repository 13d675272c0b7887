#include "doppel/track/track_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr int kCell = 320;  // pixels
constexpr int kMaxColumns = 4, kManyVertices = 100000;
const cv::Scalar kMaskColour(80, 220, 80), kSurfaceColour(60, 60, 255), kLandmarkColour(60, 230, 255),
    kSeenColour(255, 160, 60);

/// A window of a camera's image; drawings use the coordinates of the whole image.
class Cell {
 public:
  Cell(const cv::Mat& image, const cv::Mat& mask, const CropBox& box) : box_(box) {
    const cv::Mat from = image.empty() ? mask : image;
    image_ = from.empty() ? cv::Mat(kCell, kCell, CV_8UC3, cv::Scalar::all(0)) : crop_image(from, box, kCell);
    if (image_.channels() == 1) cv::cvtColor(0.4 * image_, image_, cv::COLOR_GRAY2BGR);
    if (mask.empty()) return;
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(crop_mask(mask, box, kCell), contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    cv::drawContours(image_, contours, -1, kMaskColour, 1, cv::LINE_8);
  }
  void dot(const Eigen::Vector2d& pixel, const cv::Scalar& colour, int radius) {
    const double scale = box_.image_pixels_per_pixel(kCell);
    const cv::Point at(cvFloor((pixel.x() - box_.u0) / scale), cvFloor((pixel.y() - box_.v0) / scale));
    cv::circle(image_, at, radius, colour, cv::FILLED, cv::LINE_AA);
  }
  cv::Mat& image() { return image_; }

 private:
  CropBox box_;
  cv::Mat image_;
};

}  // namespace

TrackSheet::TrackSheet(const std::vector<PinholeCamera>& cameras, const PoseModel& model)
    : cameras_(cameras), model_(model), outlines_(model.character(), cameras, kManyVertices) {
  const int available = static_cast<int>(cameras.size()), columns = std::min(available, kMaxColumns);
  for (int i = 0; i < columns; ++i) shown_.push_back(i * available / columns);
}

void TrackSheet::add(long frame, const FootageFrame& seen, const TrackedFrame& found) {
  const PosedBody body = model_.pose(found.dofs, false);
  const std::vector<OutlineVertex> outline = outlines_.find(seen.evidence, posed_vertices(model_, body));
  cv::Mat row(kCell, 0, CV_8UC3);
  for (const int camera : shown_) {
    const auto c = as_size(camera);
    const ViewEvidence& view = seen.evidence[c];
    const PinholeCamera& lens = cameras_[c];
    CropBox box = view.outline.box();
    if (box.empty()) box = {0, 0, std::max(lens.width, lens.height)};
    Cell cell(seen.images.empty() ? cv::Mat() : seen.images[c], seen.masks[c], box);
    for (const OutlineVertex& vertex : outline)
      if (vertex.camera == camera) cell.dot(lens.project(model_.vertex(body, vertex.vertex)), kSurfaceColour, 1);
    for (int m = 0; m < model_.num_landmarks(); ++m) {
      const Keypoint& point = view.keypoints[m];
      if (point.confidence >= kSeenConfidence) cell.dot({point.x, point.y}, kSeenColour, 2);
      cell.dot(lens.project(model_.landmark(body, m)), kLandmarkColour, 2);
    }
    cv::putText(cell.image(), fmt::format("{}, camera {}, {}", frame, lens.name, to_string(found.state)),
                {6, kCell - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar::all(255), 1, cv::LINE_AA);
    cv::hconcat(row, cell.image(), row);
  }
  rows_.push_back(row);
}

cv::Mat TrackSheet::image() const {
  cv::Mat sheet;
  cv::vconcat(rows_, sheet);
  return sheet;
}

}  // namespace doppel
