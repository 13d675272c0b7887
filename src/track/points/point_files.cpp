#include "doppel/track/points/point_files.h"

#include <fmt/format.h>

#include <limits>

#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"

namespace doppel {

void write_trc(const std::filesystem::path& path, const PointMotion& motion) {
  const std::size_t frames = motion.frames.size(), points = motion.points.size();
  std::string text = fmt::format("PathFileType\t4\t(X/Y/Z)\t{}\n", path.filename().string());
  text += "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n";
  text += fmt::format("{0}\t{0}\t{1}\t{2}\tm\t{0}\t{3}\t{1}\n", motion.fps, frames, points, motion.first_row + 1);
  std::string names = "Frame#\tTime", axes = "\t";
  for (std::size_t k = 0; k < points; ++k) {
    names += fmt::format("\t{}\t\t", motion.points[k]);
    axes += fmt::format("\tX{0}\tY{0}\tZ{0}", k + 1);
  }
  text += names + "\n" + axes + "\n";
  for (std::size_t f = 0; f < frames; ++f) {
    const long row = motion.first_row + static_cast<long>(f);
    text += fmt::format("{}\t{:.6f}", row + 1, static_cast<double>(row) / motion.fps);
    for (const auto& point : motion.frames[f])
      text += point ? fmt::format("\t{:.6f}\t{:.6f}\t{:.6f}", point->x(), point->y(), point->z()) : "\t\t\t";
    text += "\n";
  }
  write_atomically(path, text);
}

void write_point_array(const std::filesystem::path& path, const PointMotion& motion) {
  constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> values;
  for (const PointMotion::Frame& frame : motion.frames)
    for (const auto& point : frame)
      for (int axis = 0; axis < 3; ++axis) values.push_back(point ? static_cast<float>((*point)[axis]) : kNothing);
  write_npy(path, values.data(),
            {static_cast<std::int64_t>(motion.frames.size()), static_cast<std::int64_t>(motion.points.size()), 3});
}

}  // namespace doppel
