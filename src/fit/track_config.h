#pragma once

#include "doppel/core/config.h"
#include "doppel/fit/dof_choice.h"
#include "doppel/fit/multiview.h"
#include "doppel/fit/surface_tracker.h"

namespace doppel {

/// How a capture is tracked: what `configs/track/multiview.yaml` holds.
struct TrackConfig {
  MultiviewOptions fit;
  DofChoice dofs;
  SurfaceOptions surface;
  std::vector<std::string> shared_dofs;  ///< names of DoFs whose usual values are found first (`shared_dofs.h`)
  int shared_frames = 10;           ///< of each sequence that they are found from
  int template_frames = 0;             ///< of each sequence that the worn template is found from; 0: the template as it is
  double smoothing = 2.0;          ///< sigma of the Gaussian under which parabolas follow the poses, frames; 0: none
};

/// Every key may be missing. @throws FileError for unknown keys and impossible values
TrackConfig read_track_config(const ConfigDocument& document);

}  // namespace doppel
