#pragma once

#include <filesystem>
#include <vector>

namespace doppel {

/// DoF values over time: frame f holds the D numbers of a skeleton's DoFs, in the file's own units (the skeleton's
/// weights turn them into metres and radians).
struct Motion {
  std::vector<std::vector<double>> frames;  ///< [F][D]
  std::vector<long> ids;                    ///< [F] the frame ids of the file; 0,1,2,... normally

  int num_frames() const { return static_cast<int>(frames.size()); }
};

/// Reads "Skeletool Motion File V1.0" and V0.1. In V0.1 all values after the first three have the opposite sign. Rows
/// are read in file order. Skipped or repeated ids and surplus columns are logged as a warning.
/// @param num_dofs the skeleton's D
/// @throws FileError: header, too few values in a row, not a number, no rows
Motion read_motion(const std::filesystem::path& path, int num_dofs);
/// Writes V1.0 with 9 significant digits (17 with `exact`).
void write_motion(const std::filesystem::path& path, const Motion& motion, bool exact = false);

}  // namespace doppel
