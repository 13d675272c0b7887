#pragma once

#include <cstdint>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/train/schedule.h"

namespace doppel {

/// What a step of the hybrid trains (6.12.4): the radiance field around a fixed mesh, the mesh against the fixed
/// radiance field, or both.
enum class HybridPhase { field, refine, joint };

/// One round of the alternation (6.12.4.3).
struct HybridRound {
  std::int64_t field = 110000;  ///< steps of the radiance field
  std::int64_t refine = 400;    ///< steps of DeltaNet
  double variance = 0.01;       ///< lambda of 6.28 in this round
};
void describe_keys(const Keys& keys, HybridRound& round);

/// The rounds, followed by steps that train everything end to end.
class HybridPlan {
 public:
  /// The two rounds of A.3.
  HybridPlan();

  std::int64_t iterations() const;
  Schedule schedule() const;

  struct Position {
    HybridPhase phase = HybridPhase::field;
    bool first = false;     ///< the first step of this phase
    double variance = 0.0;  ///< lambda; in the joint phase that of the last round
  };
  /// @param step steps done so far
  Position at(std::int64_t step) const;
  /// Whether a step at or after `step` trains the field, and whether one trains the mesh.
  bool trains_field_from(std::int64_t step) const { return comes(HybridPhase::field, step); }
  bool trains_mesh_from(std::int64_t step) const { return comes(HybridPhase::refine, step); }

 private:
  struct Part {
    HybridPhase phase;
    std::int64_t steps;
    double variance;
  };
  std::vector<Part> parts() const;
  /// Whether a step of this phase, or of the joint one, comes at or after `step`.
  bool comes(HybridPhase phase, std::int64_t step) const;

  friend void describe_keys(const Keys& keys, HybridPlan& plan);

  std::vector<HybridRound> rounds_;
  std::int64_t joint_ = 0;
  double field_rate_ = 5e-4, refine_rate_ = 1e-4, joint_rate_ = 1e-4, final_ratio_ = 0.1;
};
/// The keys `rounds` (a list), `joint` and `rates`.
void describe_keys(const Keys& keys, HybridPlan& plan);

}  // namespace doppel
