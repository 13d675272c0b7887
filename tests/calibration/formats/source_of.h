#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/calibration/formats/format.h"
#include "doppel/core/file_head.h"

namespace doppel::support {

/// A file or folder as the formats of calibrations see it.
inline CalibrationSource source_of(const std::filesystem::path& path) {
  return {path, read_head(path, 16 << 10), std::filesystem::is_directory(path)};
}

inline std::vector<std::string> names_of(const Calibration& calibration) {
  std::vector<std::string> names;
  for (const Camera& camera : calibration.cameras) names.push_back(camera.name);
  return names;
}

}  // namespace doppel::support
