#pragma once

#include <string>
#include <vector>

namespace doppel::fuzz {

/// A valid calibration, as one text: files after the first one follow after `kNextFile`.
struct CalibrationSeed {
  const char* format;                   ///< as CalibrationFormat::name
  std::vector<const char*> file_names;  ///< the first one is read
  std::string bytes;
};

inline constexpr const char* kNextFile = "\n#file\n";

/// One of every format but the two that are pickles, which the target `pickle` covers.
std::vector<CalibrationSeed> calibration_seeds();

}  // namespace doppel::fuzz
