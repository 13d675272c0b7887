#pragma once

#include "doppel/core/config.h"
#include "doppel/track/fit/dof_choice.h"
#include "doppel/track/multiview/multiview.h"
#include "doppel/track/surface/surface_tracker.h"

namespace doppel {

/// The configuration of the multi-view fit.
struct TrackConfig {
  MultiviewOptions fit;
  DofChoice dofs;
  SurfaceOptions surface;
  std::vector<std::string> shared_dofs;  ///< names of the DoFs that are fitted first (`SharedDofs`)
  int shared_frames = 10;                ///< frames of each sequence that they are fitted to
  int template_frames = 0;               ///< frames of each sequence for the template fit; 0: no template fit
  double smoothing = 2.0;                ///< sigma of the Gaussian of `smooth_poses` with degree 2, frames; 0: none
};

void describe_keys(const Keys& keys, TrackConfig& config);
/// Every key may be missing. @param config the values of missing keys
/// @throws FileError for unknown keys and impossible values
TrackConfig read_track_config(const ConfigDocument& document, TrackConfig config = {});

}  // namespace doppel
