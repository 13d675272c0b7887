#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/layouts/folder_layout.h"
#include "doppel/data/capture/layouts/guess_capture.h"

namespace doppel {

/// A public dataset that `guess_capture` reads, once it is known which of the files are what.
struct PublicDataset {
  std::string name;
  std::vector<std::string> signs;  ///< regular expressions; the folder has a file that matches, for each of them
  GuessHints hints;
  std::string calibration_above = "";  ///< name of the calibration in the folder above, if it stands there; or empty
};

/// The layout of a dataset. Without signs it fits every folder and is not sure.
FolderLayout dataset_layout(PublicDataset dataset);

}  // namespace doppel
