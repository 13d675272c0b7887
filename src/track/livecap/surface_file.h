#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "doppel/track/frame_file.h"

namespace doppel {

/// Writes the surfaces of consecutive frames, float32 [frames, N, 3], each averaged with its neighbours (4.8).
class SurfaceFile {
 public:
  /// @param filter false: surfaces are written unfiltered
  SurfaceFile(const std::filesystem::path& path, int num_vertices, bool filter)
      : file_(path, num_vertices, 3), filter_(filter) {}

  /// @param vertices [3,N] world metres @param follows whether it was tracked from the frame before
  void add(const Eigen::Matrix3Xd& vertices, bool follows) {
    if (held_.cols() > 0) write(follows ? vertices : held_);
    before_ = held_.cols() > 0 && follows ? held_ : vertices;
    held_ = vertices;
  }
  /// Writes the last surface and completes the file.
  void close() {
    if (held_.cols() > 0) write(held_);
    file_.close();
  }

 private:
  void write(const Eigen::Matrix3Xd& after) {
    file_.append(filter_ ? Eigen::Matrix3Xd(0.15 * before_ + 0.7 * held_ + 0.15 * after) : held_);
  }

  FrameFile file_;
  bool filter_;
  Eigen::Matrix3Xd before_, held_;  ///< the last two; `held_` waits for its successor
};

}  // namespace doppel
