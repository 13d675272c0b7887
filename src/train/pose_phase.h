#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/train/schedule.h"

namespace doppel {

/// A stretch of PoseNet's training with a learning rate and weights of its own (A.1.1).
struct PosePhase {
  std::int64_t iterations = 120000;
  double learning_rate = 1e-5;
  double keypoints = 0.01;  ///< weight of the keypoint loss
  double limits = 0.0;      ///< weight of the limits loss at first
  /// Shares of the phase after which the limits count a tenth, and nothing any more.
  double limits_reduced_at = 1.0 / 3.0, limits_off_at = 0.5;

  /// @param progress of the phase, 0 to 1
  double limits_weight(double progress) const;
};

/// The phases of a configuration, one after the other.
class PosePhases {
 public:
  /// The three of the thesis.
  PosePhases();
  /// Key `phases` of a configuration: a list of mappings with the keys above; without it, the thesis's.
  /// @throws FileError at the key
  static PosePhases read(const ConfigReader& root);

  std::int64_t iterations() const;  ///< of all
  /// The learning rate over all of them.
  Schedule schedule() const;

  struct Place {
    const PosePhase* phase;
    double progress;  ///< of this phase, 0 to 1
  };
  /// @param step steps done so far
  Place at(std::int64_t step) const;

 private:
  std::vector<PosePhase> phases_;
};

}  // namespace doppel
