#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "doppel/calibration/formats/calibration.h"
#include "doppel/data/capture/layouts/folder_listing.h"
#include "doppel/data/capture/mask_values.h"
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
  std::map<std::string, MaskValues> masks;      ///< of streams whose paths have a word for masks, by first file
  /// First files of streams of keypoints, and the built-in map that fits; several where number and limbs do not decide
  /// ("names": a table).
  std::map<std::string, std::vector<std::string>> keypoint_maps;
  /// First files of keypoints of all frames: the numbers of the first and the last frame that they tell anything of.
  std::map<std::string, std::pair<long, long>> keypoint_frames;
  std::vector<std::string> joint_tables;  ///< tables of joints in space (joint_detections.h), in natural order
  std::vector<std::string> notes;         ///< files that look usable and are not, in sentences
};

/// Reads what the files of a folder say. @throws Error as `FolderListing::files`
FolderContent read_folder(const FolderListing& listing);

}  // namespace doppel
