#pragma once

#include <map>
#include <string>
#include <utility>

namespace doppel {

/// Where the files of all cameras are: one path with placeholders for all of them (path_pattern.h), or a path for each
/// camera by its name, where the names of the files follow no pattern.
class CameraPaths {
 public:
  CameraPaths() = default;
  CameraPaths(std::string pattern) : pattern_(std::move(pattern)) {}  // NOLINT(google-explicit-constructor)
  CameraPaths(const char* pattern) : pattern_(pattern) {}             // NOLINT(google-explicit-constructor)
  explicit CameraPaths(std::map<std::string, std::string> by_camera) : by_camera_(std::move(by_camera)) {}

  bool empty() const { return pattern_.empty() && by_camera_.empty(); }
  /// The path of one camera, its placeholders not filled in. @throws Error when the paths do not name this camera
  const std::string& of(const std::string& camera) const;
  /// The paths by camera; empty when one path holds for all.
  const std::map<std::string, std::string>& by_camera() const { return by_camera_; }
  /// The path for all cameras, or the path of one of them: for what the paths of all cameras have in common, like the
  /// extension.
  const std::string& sample() const { return by_camera_.empty() ? pattern_ : by_camera_.begin()->second; }
  /// For messages and reports: the path, or "camera: path" for each camera.
  std::string to_string() const;

  bool operator==(const CameraPaths&) const = default;

 private:
  std::string pattern_;
  std::map<std::string, std::string> by_camera_;
};

}  // namespace doppel
