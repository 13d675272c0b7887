#pragma once

#include "doppel/core/config.h"
#include "doppel/track/fit/dof_choice.h"
#include "doppel/track/livecap/livecap.h"

namespace doppel {

/// The configuration of the one-camera tracker. A file counts in the units of the thesis, millimetres and pixels of an
/// image 540 wide; reading converts them to those of the options.
struct LivecapConfig {
  LivecapOptions fit;
  DofChoice dofs;
  double smoothing = 0.0;  ///< sigma of the Gaussian over the poses, frames; 0: none
  bool filter = true;      ///< average the vertices with those of the adjacent frames, weights 0.15 0.7 0.15 (4.8)
};

void describe_keys(const Keys& keys, LivecapConfig& config);
/// Every key may be missing. @throws FileError for unknown keys and impossible values
LivecapConfig read_livecap_config(const ConfigDocument& document);

}  // namespace doppel
