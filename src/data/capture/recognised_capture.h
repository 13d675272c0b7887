#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"

namespace doppel {

/// A capture folder of a public dataset, recognised without a capture.yaml.
struct RecognisedCapture {
  Capture capture;
  std::string layout;                     ///< "DynaCap", "ASH/TriHuman", or one of `dataset_names`
  std::vector<std::string> notes;         ///< which files were recognised as what, in sentences
  std::vector<std::string> missing = {};  ///< what the dataset does not have, and what to do about it
};

}  // namespace doppel
