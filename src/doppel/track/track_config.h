#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/track/multiview.h"

namespace doppel {

/// How a capture is tracked: what `configs/track/multiview.yaml` holds.
struct TrackConfig {
  MultiviewOptions fit;
  std::vector<std::string> dofs;  ///< names of those to find; empty: all that landmarks show (`observable_dofs`)
  double smoothing = 1.0;         ///< sigma of the Gaussian over the poses, frames; 0: none
};

/// Every key may be missing. @throws FileError for unknown keys and impossible values
TrackConfig read_track_config(const ConfigDocument& document);
/// The DoFs that a configuration names, or the observable ones. @throws UsageError for a name the skeleton does not
/// have
std::vector<int> chosen_dofs(const TrackConfig& config, const Skeleton& skeleton, const std::vector<Marker>& landmarks);

}  // namespace doppel
