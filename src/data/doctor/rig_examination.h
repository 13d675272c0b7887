#pragma once

#include <utility>
#include <vector>

#include "doppel/data/doctor/consensus.h"
#include "doppel/data/doctor/finding.h"

namespace doppel {

/// What the cameras say together.
struct RigExamination {
  PersonOfCamera person;
  std::vector<SupposedView> views;  ///< [C] as calibrated, or as the best explanation of a faulty camera supposes
  std::vector<bool> faulty;         ///< [C] a fault of the rig or of the keypoints was found
  bool whole_rig_faulty = false;    ///< a fault of all cameras together was found, and is corrected in `views`
  Consensus nominal;                ///< with the cameras as calibrated; if they do not agree, as in `views`
  std::vector<double> explained;    ///< [C] residual as `views` suppose, share of the person's size
  std::vector<std::pair<int, int>> exchanged;  ///< cameras that have the keypoints of each other

  bool is_exchanged(int camera) const;
};

/// Finds cameras that disagree with the consensus of the others, tries all explanations on each, and takes the one that
/// leaves the least residual with the fewest fitted numbers. If no cameras agree, explanations that hold for all
/// cameras, or for two that were swapped, are tried first.
/// @return nothing when there are fewer than two cameras, or nobody was detected
std::optional<RigExamination> examine_rig(const Sightings& seen, std::vector<Finding>& findings);

}  // namespace doppel
