#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture/capture_guess.h"
#include "doppel/data/capture/recognised_capture.h"

namespace doppel {

/// A public dataset that `guess_capture` reads, once it is known which of the files are what.
struct DatasetLayout {
  std::string name;
  std::vector<std::string> signs;  ///< regular expressions; the folder has a file that matches, for each of them
  GuessHints hints;
  std::string calibration_above;  ///< name of the calibration in the folder above, if it stands there; or empty
};
const std::vector<DatasetLayout>& dataset_layouts();
std::vector<std::string> dataset_names();

/// Recognises a folder of one of these datasets. @return nothing when the signs of none are there, or when calibration
/// or footage are missing
std::optional<RecognisedCapture> recognise_dataset(const std::filesystem::path& folder);

}  // namespace doppel
