#pragma once

#include "doppel/core/config.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

/// Keys that the configurations of all trackers share.

inline void read_weight(const ConfigReader& root, const char* term, double& weight) {
  weight = root.section(term).get("weight", weight, between(0.0, 1e12));
}

inline void read_image_term(const ConfigReader& root, const char* term, double& weight, double& scale) {
  read_weight(root, term, weight);
  scale = root.section(term).get("scale", scale, between(1e-3, 1e6));
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
