#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/layouts/folder_layout.h"

namespace doppel {

/// A public release of a studio: `training|testing/<videos>/<prefix>NNN.<ext>`, masks of the same cameras in
/// `training|testing/<masks>/`, where NNN is the index of the camera in the calibration.
struct StudioRelease {
  std::string name, prefix;
  struct Folders {
    std::string videos, masks;  ///< `videos` is empty when they stand in the split's folder itself
  };
  std::vector<Folders> folders;    ///< the first that both hold files count
  bool largest_component = false;  ///< as in `SequenceEntry`
};

/// The layout of a release. Calibration, character and poses are searched for in the folder and up to two levels below
/// it. Cuts are read from `<split>/frames.csv` (columns frame,segment) if it exists.
/// Its guess throws Error when calibration or character are missing, or when one of them or the poses are ambiguous.
FolderLayout studio_layout(StudioRelease release);

}  // namespace doppel
