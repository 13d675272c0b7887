#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/npy.h"

namespace doppel {

/// Writes arrays of consecutive frames into one file: float32 [frames, rows, columns].
class FrameFile {
 public:
  FrameFile(const std::filesystem::path& path, int rows, int columns) : stream_(path, {rows, columns}) {}

  /// @param numbers [rows * columns]
  void append(const std::vector<double>& numbers) {
    const std::vector<float> floats(numbers.begin(), numbers.end());
    append(floats);
  }
  /// @param points [rows]; the file must have three columns
  void append(const std::vector<Eigen::Vector3d>& points) {
    std::vector<float> floats;
    for (const Eigen::Vector3d& point : points)
      for (const double x : point) floats.push_back(static_cast<float>(x));
    append(floats);
  }
  void append(const Eigen::Matrix3Xd& points) {
    const Eigen::Matrix3Xf floats = points.cast<float>();
    append(std::span(floats.data(), as_size(floats.size())));
  }
  void append(std::span<const float> numbers) { stream_.append(numbers); }
  /// Completes the file. Without this call no file remains.
  void close() { stream_.close(); }

 private:
  NpyStream stream_;
};

}  // namespace doppel
