#pragma once

#include <cstdint>
#include <vector>

#include "doppel/core/config.h"
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

/// The rounds, followed by steps that train everything end to end.
class HybridPlan {
 public:
  /// The two rounds of A.3.
  HybridPlan();
  /// Keys: `rounds` (a list of mappings with the keys of HybridRound), `joint` (steps, default 0), and the section
  /// `rates`: `field`, `refine` and `joint` are the rates at the start of such a phase, `final_ratio` their factor at
  /// its end.
  /// @throws FileError at the key
  static HybridPlan read(const ConfigReader& root);

  std::int64_t iterations() const;
  Schedule schedule() const;

  struct Place {
    HybridPhase phase = HybridPhase::field;
    bool first = false;     ///< the first step of this phase
    double variance = 0.0;  ///< lambda; in the joint phase that of the last round
  };
  /// @param step steps done so far
  Place at(std::int64_t step) const;
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

  std::vector<HybridRound> rounds_;
  std::int64_t joint_ = 0;
  double field_rate_ = 5e-4, refine_rate_ = 1e-4, joint_rate_ = 1e-4, final_ratio_ = 0.1;
};

}  // namespace doppel
