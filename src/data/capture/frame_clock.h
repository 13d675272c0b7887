#pragma once

#include <cmath>

namespace doppel {

/// When the rows of a motion were filmed, in frames of one camera's video: row r at the time r * rate + offset.
struct FrameClock {
  double rate = 1.0;    ///< video frames per row: the camera's frames per second over those of the capture
  double offset = 0.0;  ///< time of row 0

  double time(long row) const { return static_cast<double>(row) * rate + offset; }
  /// The video frame nearest to the time of a row. A half is rounded up.
  long frame(long row) const { return static_cast<long>(std::floor(time(row) + 0.5)); }
  /// Whether every row falls on a frame: then row r is frame r + offset.
  bool is_whole() const { return rate == 1.0 && offset == std::floor(offset); }
  /// The number of rows, from row 0 on, whose frames lie before the end of a video of `frames` frames; 0 or more.
  long num_rows(long frames) const {
    auto rows = static_cast<long>(std::ceil((static_cast<double>(frames) - 0.5 - offset) / rate));
    while (rows > 0 && frame(rows - 1) >= frames) --rows;  // a rounding error of the division
    return rows < 0 ? 0 : rows;
  }
};

}  // namespace doppel
