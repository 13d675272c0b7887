#pragma once

#include <cstdint>
#include <vector>

#include "doppel/core/options.h"

namespace doppel {

/// The learning rate as a function of the step; it has no state.
///
/// After `warmup` steps of linear growth:
/// - constant: the base rate (thesis A.2);
/// - cosine: half a cosine from the base rate down to `final_ratio` of it at the last step;
/// - pieces: a rate for each piece (not a word of a configuration; PosePhases and HybridPlan use it).
struct Schedule {
  enum class Kind { constant, cosine, pieces };
  struct Piece {
    std::int64_t end;  ///< steps done at its end
    double rate;
    double final_ratio = 1.0;  ///< half a cosine from the rate down to this factor of it
  };

  Kind kind = Kind::constant;
  double learning_rate = 1e-4;
  std::int64_t warmup = 0;
  std::int64_t iterations = 1;  ///< length of the run (cosine)
  double final_ratio = 0.0;     ///< cosine
  std::vector<Piece> pieces;    ///< pieces

  /// @param step steps done so far: 0 for the first one
  double rate(std::int64_t step) const;
};
/// All keys but the number of steps. `kind` must not be `pieces`.
void describe_keys(const Keys& keys, Schedule& schedule);

}  // namespace doppel
