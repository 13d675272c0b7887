#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"

namespace doppel {

/// What a folder is taken for: a capture, and why.
struct CaptureGuess {
  std::string layout;  ///< "DynaCap", "ASH/TriHuman", ...; empty: a capture.yaml, or no known layout
  Capture capture;
  std::vector<std::string> found;    ///< what was taken for what, a sentence each
  std::vector<std::string> missing;  ///< what could not be found, and what to do about it, a sentence each
  bool complete = false;             ///< whether there are a calibration and footage: a capture.yaml can be written
};

}  // namespace doppel
