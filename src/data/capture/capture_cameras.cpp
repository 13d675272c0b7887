#include "doppel/data/capture/capture_cameras.h"

#include <algorithm>
#include <cmath>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/calibration/formats/relative_intrinsics.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

namespace {

constexpr int kMacroblock = 16;         // pixels; encoders pad both sides to multiples of it
constexpr double kExactAspect = 0.002;  // a pixel of rounding in an image 500 wide

std::string joined_names(const std::vector<Camera>& cameras) {
  std::string names;
  for (const Camera& camera : cameras) names += (names.empty() ? "" : ", ") + camera.name;
  return names;
}

/// Names of cameras that stand as keys in a capture.
template <typename Value>
void check_keys(const std::map<std::string, Value>& by_camera, const std::string& key, const Capture& capture,
                const std::vector<Camera>& all) {
  for (const auto& entry : by_camera)
    if (std::none_of(all.begin(), all.end(), [&](const Camera& camera) { return camera.name == entry.first; }))
      fail("{}: `{}` names camera '{}', but {} has {}", capture.name, key, entry.first, capture.calibration,
           joined_names(all));
}

void check_all_keys(const Capture& capture, const std::vector<Camera>& all) {
  check_keys(capture.camera_fps, "camera_fps", capture, all);
  for (const SequenceEntry& sequence : capture.sequences) {
    check_keys(sequence.frame_offset, "frame_offset", capture, all);
    check_keys(sequence.videos.by_camera(), "videos", capture, all);
    check_keys(sequence.masks.by_camera(), "masks", capture, all);
    check_keys(sequence.mask_offset, "mask_offset", capture, all);
    check_keys(sequence.keypoints.by_camera(), "keypoints", capture, all);
    check_keys(sequence.keypoint_offset, "keypoint_offset", capture, all);
    if (sequence.subtraction) check_keys(sequence.subtraction->empty.by_camera(), "empty", capture, all);
  }
}

}  // namespace

std::vector<Camera> calibrated_cameras(const Capture& capture) {
  return read_posed_cameras(capture.calibration_path(), capture.calibration_options);
}

CaptureCameras choose_cameras(const Capture& capture) {
  const std::vector<Camera> all = calibrated_cameras(capture);
  check_all_keys(capture, all);
  std::vector<std::string> wanted = capture.cameras;
  if (wanted.empty())
    for (const Camera& camera : all) wanted.push_back(camera.name);
  CaptureCameras chosen;
  for (const std::string& name : wanted) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const Camera& c) { return c.name == name; });
    if (found == all.end())
      fail("{} asks for camera '{}', but {} has {}", capture.name, name, capture.calibration, joined_names(all));
    chosen.cameras.push_back(*found);
    chosen.file_index.push_back(static_cast<int>(found - all.begin()));
  }
  return chosen;
}

bool is_without_padding(const Camera& camera, cv::Size images) {
  const auto is_cut = [](int calibrated, int seen) {
    return calibrated % kMacroblock == 0 && seen < calibrated && calibrated - seen < kMacroblock;
  };
  return (camera.height == images.height && is_cut(camera.width, images.width)) ||
         (camera.width == images.width && is_cut(camera.height, images.height));
}

Camera fit_to_images(const Camera& camera, cv::Size images, const std::string& source) {
  if (camera.width == images.width && camera.height == images.height) return camera;
  if (camera.width == 0) return with_image_size(camera, images.width, images.height);
  if (is_without_padding(camera, images)) {
    log::info("camera {}: calibration for {}x{}, {} shows {}x{} pixels, without the padding on the right and below",
              camera.name, camera.width, camera.height, source, images.width, images.height);
    Camera cut = camera;
    cut.width = images.width;
    cut.height = images.height;
    return cut;
  }
  const double calibrated = static_cast<double>(camera.width) / camera.height;
  const double seen = static_cast<double>(images.width) / images.height;
  const double stretch = seen / calibrated - 1.0;
  if (std::abs(stretch) > kMaxStretch)
    fail(
        "camera {}: {} shows {}x{} pixels, but the calibration is for {}x{}, another aspect ratio; the images were "
        "cropped or turned (by their metadata? See \"Turned videos and images\" in docs/capture.md), or this is the "
        "calibration of other cameras",
        camera.name, source, images.width, images.height, camera.width, camera.height);
  if (std::abs(stretch) > kExactAspect)
    log::warn(
        "camera {}: {} shows {}x{} pixels, the calibration is for {}x{}; its aspect ratio differs by {:.2f} %. The "
        "calibration is scaled by {:.4f} along x and {:.4f} along y; if the images were cropped instead, state the "
        "calibration of the cropped images",
        camera.name, source, images.width, images.height, camera.width, camera.height, 100.0 * std::abs(stretch),
        static_cast<double>(images.width) / camera.width, static_cast<double>(images.height) / camera.height);
  else
    log::info("camera {}: calibration for {}x{} scaled to the video's {}x{}", camera.name, camera.width, camera.height,
              images.width, images.height);
  return camera.scaled_to(images.width, images.height);
}

}  // namespace doppel
