#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/track/multiview.h"
#include "doppel/track/surface_tracker.h"

namespace doppel {

/// How a capture is tracked: what `configs/track/multiview.yaml` holds.
struct TrackConfig {
  MultiviewOptions fit;
  /// Names of DoFs, in which * stands for any letters. Those to find; empty: all that landmarks show
  /// (`observable_dofs`). Those to find as well; those that keep the rest pose's values after all.
  std::vector<std::string> dofs, also, hold;
  SurfaceOptions surface;
  int worn_frames = 0;     ///< of each sequence that the worn template is found from; 0: the template as it is
  double smoothing = 1.0;  ///< sigma of the Gaussian over the poses, frames; 0: none
};

/// Every key may be missing. @throws FileError for unknown keys and impossible values
TrackConfig read_track_config(const ConfigDocument& document);
/// The DoFs that a configuration names, or the observable ones, ascending. @throws UsageError for a name that no DoF of
/// the skeleton has
std::vector<int> chosen_dofs(const TrackConfig& config, const Skeleton& skeleton, const std::vector<Marker>& landmarks);

}  // namespace doppel
