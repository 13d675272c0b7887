#pragma once

#include <cstdint>
#include <vector>

#include "doppel/core/config.h"

namespace doppel {

/// The learning rate as a function of the step; it has no state.
///
/// After `warmup` steps of linear growth:
/// - constant: the base rate (thesis A.2);
/// - cosine: half a cosine from the base rate down to `final_ratio` of it at the last step;
/// - step: times `factor` every `interval` steps;
/// - exponential: times `factor` per `interval` steps, smoothly;
/// - pieces: a rate for each piece (not a word of a configuration; PosePhases and HybridPlan use it).
struct Schedule {
  enum class Kind { constant, cosine, step, exponential, pieces };
  struct Piece {
    std::int64_t end;  ///< steps done at its end
    double rate;
    double final_ratio = 1.0;  ///< half a cosine from the rate down to this factor of it
  };

  Kind kind = Kind::constant;
  double learning_rate = 1e-4;
  std::int64_t warmup = 0;
  std::int64_t iterations = 1;   ///< length of the run (cosine)
  double final_ratio = 0.0;      ///< cosine
  double factor = 0.1;           ///< step, exponential
  std::int64_t interval = 1000;  ///< step, exponential
  std::vector<Piece> pieces;     ///< pieces

  /// Reads `learning_rate`, `schedule`, `warmup`, `final_ratio`, `decay_factor`, `decay_interval`.
  static Schedule read(const ConfigReader& reader, std::int64_t iterations);
  /// @param step steps done so far: 0 for the first one
  double rate(std::int64_t step) const;
};

}  // namespace doppel
