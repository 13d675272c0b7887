#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"
#include "doppel/track/track_view.h"

namespace doppel {

/// Shows frames as they are tracked: the surface over the image and, beside it, from a viewpoint of its own.
class Preview {
 public:
  virtual ~Preview() = default;
  /// @param image BGR, as the camera took it @param vertices [3,N] world metres @param caption a line of text on it
  /// @return false when whoever watches wants to end
  virtual bool show(const cv::Mat& image, const Eigen::Matrix3Xd& vertices, const std::string& caption) = 0;
  /// Does what must be done again and again while nothing comes. @return as `show`
  virtual bool idle() { return true; }
  /// Whether every frame is wanted, even if that takes longer than tracking it.
  virtual bool wants_all() const = 0;
  /// Completes what was written.
  virtual void close() {}
};

/// @param target "window", or an .mp4 file to write
/// In the window the keys a and d turn the second view, q and Escape end.
/// @param camera without distortion @throws UsageError for another file, a window without a screen, or a texture that
/// does not fit the mesh
std::unique_ptr<Preview> open_preview(const std::string& target, const Camera& camera, const TriangleMesh& mesh,
                                      double frames_per_second, const TrackViewOptions& options = {});
/// Reads what is to be worn. @throws UsageError when it is no image; empty for an empty path
cv::Mat read_texture(const std::string& path);

}  // namespace doppel
