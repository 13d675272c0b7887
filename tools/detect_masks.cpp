#include "detect_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/geometry/image_file.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

cv::Mat read_mask(const fs::path& file) {
  cv::Mat mask = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (mask.empty()) fail_at({file.string(), 0}, "the mask of the network is missing or cannot be decoded");
  return mask;
}

/// The masks of one row of the motion, and where they came from.
class Moment {
 public:
  /// @param camera for images of the mask's size
  void add(const fs::path& file, const Camera& camera) {
    masks_.push_back(read_mask(file));
    files_.push_back(file);
    cameras_.push_back(camera);
  }

  /// Writes the masks that change.
  SettledPixels settle() {
    const std::vector<cv::Mat> before = masks_;
    const SettledPixels changes = settle_masks(masks_, cameras_);
    for (std::size_t i = 0; i < masks_.size(); ++i)
      if (cv::countNonZero(masks_[i] != before[i]) > 0) write_image(files_[i], masks_[i]);
    return changes;
  }

 private:
  std::vector<cv::Mat> masks_;
  std::vector<Camera> cameras_;
  std::vector<fs::path> files_;
};

/// The masks of one camera: where they lie, and which of them were compared.
class CameraMasks {
 public:
  CameraMasks(const DetectSource& source, fs::path folder) : source_(source), folder_(std::move(folder)) {
    const cv::Mat mask = read_mask(mask_file(folder_, source.frames.front()));
    camera_ = fit_to_images(*source.calibration, mask.size(), source.images);
  }

  /// Adds the mask of a row of the motion, if the camera filmed it.
  void add_row(long row, Moment& moment) {
    const long frame = source_.clock.frame(row);
    if (frame < source_.frames.front() || frame > source_.frames.back()) return;
    compared_.insert(frame);
    moment.add(mask_file(folder_, frame), camera_);
  }

  /// Of frames between the rows nothing else is known: what may be the person becomes background.
  void settle_others() const {
    for (const long frame : source_.frames) {
      if (compared_.contains(frame)) continue;
      Moment alone;
      alone.add(mask_file(folder_, frame), camera_);
      alone.settle();
    }
  }

 private:
  const DetectSource& source_;
  fs::path folder_;
  Camera camera_;
  std::set<long> compared_;
};

using Sequences = std::map<std::string, std::vector<const DetectSource*>>;

/// The cameras of each sequence whose masks can be compared.
Sequences compared_sequences(std::span<const DetectSource> sources) {
  Sequences sequences;
  for (const DetectSource& source : sources)
    if (source.calibration) sequences[source.sequence].push_back(&source);
  std::erase_if(sequences, [](const auto& item) { return item.second.size() < 3; });
  return sequences;
}

/// The rows of the motion that some camera of a sequence has filmed.
std::pair<long, long> rows_of(std::span<const DetectSource* const> cameras) {
  std::pair<long, long> rows = filmed_rows(*cameras[0]);
  for (const DetectSource* camera : cameras) {
    const auto [first, last] = filmed_rows(*camera);
    rows = {std::min(rows.first, first), std::max(rows.second, last)};
  }
  return rows;
}

}  // namespace

fs::path mask_file(const fs::path& folder, long frame) { return folder / fmt::format("{:06}.png", frame); }

StaticBackground learn_background_of(const DetectSource& source,
                                     const std::function<cv::Mat(const cv::Mat& image)>& people) {
  const auto images = open_frames(source.images, PixelFormat::colour);
  std::vector<cv::Mat> shown, masks;
  for (const long frame : background_frames(source.frames, images->size())) {
    shown.push_back(images->read(frame).clone());
    masks.push_back(people(shown.back()));
  }
  StaticBackground background = learn_background(shown, masks);
  if (background.known_share() == 0)
    log::info("camera {}: no static background; the masks follow the colours beside their outline", source.camera);
  return background;
}

long num_compared_moments(std::span<const DetectSource> sources) {
  long moments = 0;
  for (const auto& [name, cameras] : compared_sequences(sources)) {
    const auto [first, last] = rows_of(cameras);
    moments += last - first + 1;
  }
  return moments;
}

bool is_compared(const DetectSource& source, std::span<const DetectSource> sources) {
  const Sequences compared = compared_sequences(sources);
  return source.calibration && compared.contains(source.sequence);
}

SettledPixels compare_masks(std::span<const DetectSource> sources, std::span<const fs::path> folders,
                            const std::function<bool()>& go_on) {
  SettledPixels changes;
  for (const auto& [name, cameras] : compared_sequences(sources)) {
    std::vector<CameraMasks> masks;
    for (const DetectSource* camera : cameras) masks.emplace_back(*camera, folders[camera - sources.data()]);
    const auto [first, last] = rows_of(cameras);
    for (long row = first; row <= last; ++row) {
      if (!go_on()) return changes;
      Moment moment;
      for (CameraMasks& camera : masks) camera.add_row(row, moment);
      const auto [removed, added] = moment.settle();
      changes.removed += removed;
      changes.added += added;
    }
    for (const CameraMasks& camera : masks) camera.settle_others();
  }
  return changes;
}

}  // namespace doppel::tools
