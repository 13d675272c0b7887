#pragma once

#include <array>
#include <filesystem>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/number_bytes.h"

namespace doppel::support {

/// Writes into an MP4 file that its pixels are to be turned, as phones do: the matrix a, b, c, d of its track, which
/// moves a pixel (x, y) to (a x + c y, b x + d y), y down (ISO/IEC 14496-12, track header).
inline void set_matrix(const std::filesystem::path& video, const std::array<double, 4>& matrix) {
  constexpr std::size_t kBehindName = 44;  // of the matrix in the box tkhd, version 0
  std::string bytes = read_file(video);
  const std::size_t box = bytes.find("tkhd");
  if (box == std::string::npos) fail("{} has no track header", video.string());
  const auto fixed = [](double value) {
    return number_bytes(static_cast<std::uint32_t>(static_cast<std::int32_t>(value * 65536.0)), 4, true);
  };
  bytes.replace(box + kBehindName, 8, fixed(matrix[0]) + fixed(matrix[1]));
  bytes.replace(box + kBehindName + 12, 8, fixed(matrix[2]) + fixed(matrix[3]));
  write_bytes(video, bytes);
}

/// @param quarters turns clockwise
inline void turn_video(const std::filesystem::path& video, int quarters) {
  static constexpr std::array<std::array<double, 4>, 4> kMatrices{
      {{1, 0, 0, 1}, {0, 1, -1, 0}, {-1, 0, 0, -1}, {0, -1, 1, 0}}};
  set_matrix(video, kMatrices[static_cast<std::size_t>(quarters)]);
}

}  // namespace doppel::support
