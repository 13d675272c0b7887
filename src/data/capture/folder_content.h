#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/calibration/formats/calibration.h"
#include "doppel/data/capture/file_streams.h"
#include "doppel/data/capture/video.h"

namespace doppel {

struct FoundCalibration {
  std::string path;  ///< relative to the folder; "." for the folder itself
  Calibration calibration;
};

/// What lies in a folder that may become a capture: the names of its files, and what the files say that a guess needs
/// (`guess_capture`). All paths are relative to `root`, with `/`.
struct FolderContent {
  std::filesystem::path root;                   ///< absolute
  std::vector<std::string> files;               ///< in natural order
  std::vector<FoundCalibration> calibrations;   ///< readable ones with poses, in natural order
  std::map<std::string, FootageFacts> footage;  ///< of videos, and of the first images of streams
  std::map<std::string, std::vector<std::string>>
      keypoint_maps;                      ///< first files of streams of keypoints, and the
                                          ///< built-in map that fits; several where number and limbs do not decide
                                          ///< ("names": a table)
  std::vector<std::string> joint_tables;  ///< tables of joints in space (joint_detections.h), in natural order
  std::vector<std::string> notes;         ///< files that look usable and are not, in sentences
};

/// The files of a folder, six levels deep, as in `FolderContent::files`.
std::vector<std::string> list_folder(const std::filesystem::path& folder);

/// Looks through a folder, six levels deep. Hidden folders, and folders inside that are captures themselves (they hold
/// a capture.yaml), are left out.
/// @throws Error when `folder` is not a folder, or holds more than 500,000 files
FolderContent read_folder(const std::filesystem::path& folder);

}  // namespace doppel
