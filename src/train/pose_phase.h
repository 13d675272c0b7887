#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/train/schedule.h"

namespace doppel {

/// A phase of PoseNet's training with its own learning rate and weights (A.1.1).
struct PosePhase {
  std::int64_t iterations = 120000;
  double learning_rate = 1e-5;
  double keypoints = 0.01;  ///< weight of the keypoint loss, per squared reference pixel (image 1024 wide)
  double limits = 0.0;      ///< weight of the limits loss at the start, per squared radian
  /// Shares of the phase after which the weight of the limits loss is a tenth, and 0.
  double limits_reduced_at = 1.0 / 3.0, limits_off_at = 0.5;

  /// @param progress of the phase, 0 to 1
  double limits_weight(double progress) const;
};
void describe_keys(const Keys& keys, PosePhase& phase);

/// The phases of a configuration, one after the other.
class PosePhases {
 public:
  /// The three of the thesis.
  PosePhases();

  std::int64_t iterations() const;  ///< of all phases
  /// The learning rate over all phases.
  Schedule schedule() const;

  struct Position {
    const PosePhase* phase;
    double progress;  ///< of this phase, 0 to 1
  };
  /// @param step steps done so far
  Position at(std::int64_t step) const&;
  Position at(std::int64_t step) const&& = delete;

 private:
  friend void describe_keys(const Keys& keys, PosePhases& phases);
  std::vector<PosePhase> phases_;
};
/// The key `phases`, a list.
void describe_keys(const Keys& keys, PosePhases& phases);

}  // namespace doppel
