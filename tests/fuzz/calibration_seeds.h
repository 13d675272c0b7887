#pragma once

#include <string>
#include <vector>

namespace doppel::fuzz {

/// A valid calibration: the files are divided by `kNextFile`.
struct CalibrationSeed {
  const char* format;                   ///< as CalibrationFormat::name
  std::vector<const char*> file_names;  ///< the first one is read
  std::string bytes;
};

/// At least one of every format.
std::vector<CalibrationSeed> calibration_seeds();

}  // namespace doppel::fuzz
