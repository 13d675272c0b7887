#pragma once

#include "doppel/core/config.h"
#include "doppel/track/solver/least_squares.h"

namespace doppel {

/// Keys that the configurations of all trackers have in common.

inline void read_weight(const ConfigReader& root, const char* term, double& weight) {
  weight = root.section(term).get("weight", weight, between(0.0, 1e12));
}

inline void read_image_term(const ConfigReader& root, const char* term, double& weight, double& scale) {
  read_weight(root, term, weight);
  scale = root.section(term).get("scale", scale, between(1e-3, 1e6));
}

inline void read_solver(const ConfigReader& reader, SolverOptions& solver) {
  solver.iterations = reader.get("iterations", solver.iterations, between(1, 10000));
  solver.initial_damping = reader.get("damping", solver.initial_damping, between(0.0, 1e6));
  solver.smallest_gain = reader.get("smallest_gain", solver.smallest_gain, between(0.0, 1.0));
}

}  // namespace doppel
