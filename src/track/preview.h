#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"
#include "doppel/track/track_view.h"

namespace doppel {

/// Shows tracked frames: the surface over the image and, beside it, from a second viewpoint.
class Preview {
 public:
  virtual ~Preview() = default;
  /// @param image BGR, as the camera took it @param vertices [3,N] world metres @param caption a line of text on it
  /// @return false when the user wants to end
  virtual bool show(const cv::Mat& image, const Eigen::Matrix3Xd& vertices, const std::string& caption) = 0;
  /// Handles window events while there is no new frame. @return as `show`
  virtual bool idle() { return true; }
  /// Whether every frame must be shown, even if showing takes longer than tracking.
  virtual bool wants_all() const = 0;
  /// Completes the file, if there is one.
  virtual void close() {}
};

/// @param target "window", or an .mp4 file to write
/// Keys in the window: a and d rotate the second view, q and Escape end.
/// @throws UsageError for another file type, a window without a screen, or a texture on a mesh without UVs
std::unique_ptr<Preview> open_preview(const std::string& target, const PinholeCamera& camera, const TriangleMesh& mesh,
                                      double frames_per_second, const TrackViewOptions& options = {});
/// Reads the image of a texture, 8-bit BGR, or BGRA if it has an alpha channel. @return empty for an empty path @throws
/// UsageError for a file that is not an image
cv::Mat read_texture(const std::string& path);

}  // namespace doppel
