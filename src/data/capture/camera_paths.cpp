#include "doppel/data/capture/camera_paths.h"

#include "doppel/core/error.h"

namespace doppel {

const std::string& CameraPaths::of(const std::string& camera) const {
  if (by_camera_.empty()) return pattern_;
  const auto found = by_camera_.find(camera);
  if (found == by_camera_.end())
    fail(
        "the capture names paths by camera ({}), but none of camera '{}'; add it, or leave the camera out of `cameras`",
        to_string(), camera);
  return found->second;
}

std::string CameraPaths::to_string() const {
  if (by_camera_.empty()) return pattern_;
  std::string text;
  for (const auto& [camera, path] : by_camera_) text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", camera, path);
  return text;
}

}  // namespace doppel
