#include "doppel/capture/capture_cameras.h"

#include <algorithm>
#include <cmath>

#include "doppel/calibration/read_calibration.h"
#include "doppel/calibration/relative_intrinsics.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

namespace {

std::string joined_names(const std::vector<Camera>& cameras) {
  std::string names;
  for (const Camera& camera : cameras) names += (names.empty() ? "" : ", ") + camera.name;
  return names;
}

}  // namespace

std::vector<Camera> calibrated_cameras(const Capture& capture) {
  return read_posed_cameras(capture.calibration_path(), capture.calibration_options);
}

CaptureCameras choose_cameras(const Capture& capture) {
  const std::vector<Camera> all = calibrated_cameras(capture);
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

Camera fit_to_images(const Camera& camera, cv::Size images, const std::string& source) {
  if (camera.width == images.width && camera.height == images.height) return camera;
  if (camera.width == 0) return with_image_size(camera, images.width, images.height);
  const double calibrated = static_cast<double>(camera.width) / camera.height;
  const double seen = static_cast<double>(images.width) / images.height;
  if (std::abs(seen / calibrated - 1.0) > 0.01)
    fail(
        "camera {}: {} shows {}x{} pixels, but the calibration is for {}x{}, another aspect ratio; the images were "
        "cropped or turned, or this is the calibration of other cameras",
        camera.name, source, images.width, images.height, camera.width, camera.height);
  log::info("camera {}: calibration for {}x{} scaled to the video's {}x{}", camera.name, camera.width, camera.height,
            images.width, images.height);
  return camera.scaled_to(images.width, images.height);
}

}  // namespace doppel
