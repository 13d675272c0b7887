#pragma once

#include "doppel/core/config.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

/// Keys that the configurations of all trackers share.

/// From the unit of a configuration to that of the option.
using UnitConversion = double (*)(double);
inline double same_unit(double value) { return value; }

/// The units of the numbers in a configuration.
struct ConfigUnits {
  UnitConversion per_squared_pixel = same_unit;   ///< weights, to per squared reference pixel
  UnitConversion pixels = same_unit;              ///< lengths, to reference pixels
  UnitConversion per_squared_length = same_unit;  ///< weights, to per squared metre
};

/// Reads a number and converts it; a missing key leaves the option unchanged.
inline void read_number(const ConfigReader& reader, const char* key, double& option, const Range<double>& range,
                        UnitConversion to_option) {
  const double written = reader.get<double>(key, option / to_option(1.0), range);
  if (reader.has(key)) option = to_option(written);
}

inline void read_weight(const ConfigReader& root, const char* term, double& weight,
                        UnitConversion to_option = same_unit) {
  read_number(root.section(term), "weight", weight, between(0.0, 1e12), to_option);
}

inline void read_image_term(const ConfigReader& root, const char* term, double& weight, double& scale,
                            const ConfigUnits& units = {}) {
  read_weight(root, term, weight, units.per_squared_pixel);
  read_number(root.section(term), "scale", scale, between(0.0, 1e6), units.pixels);
}

/// The section `inliers`; its old name `trust` is still read.
inline ConfigReader inlier_section(const ConfigReader& root) {
  root.renamed("trust", "inliers");
  const ConfigReader section = root.section("inliers");
  section.renamed("pixels", "threshold");
  section.renamed("share", "min_ratio");
  section.renamed("keypoints", "min_keypoints");
  section.renamed("distance", "max_distance");
  return section;
}

inline void read_solver(const ConfigReader& reader, SolverOptions& solver) {
  solver.iterations = reader.get("iterations", solver.iterations, between(1, 10000));
  solver.initial_damping = reader.get("damping", solver.initial_damping, between(0.0, 1e6));
  reader.renamed("smallest_gain", "function_tolerance");
  solver.function_tolerance = reader.get("function_tolerance", solver.function_tolerance, between(0.0, 1.0));
}

}  // namespace doppel
