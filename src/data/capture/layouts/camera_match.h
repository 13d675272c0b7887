#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture/camera_paths.h"

namespace doppel {

/// Which camera filmed which files.
struct CameraMatch {
  enum class Way { none, name, number, order };
  Way way = Way::none;
  std::vector<std::optional<int>> camera;  ///< [paths] index of the camera, where one was found
  std::vector<std::string> sequence;  ///< [paths] what remains of the path without the camera, normalised: equal for
                                      ///< the files of one sequence, which differ in the camera alone
  int num_matched() const;
  /// The number of cameras of the sequence that has most.
  int largest_sequence() const;
};

/// Finds the cameras of files by their paths, in the first of these ways that succeeds:
/// 1. by name: a part of the path holds the name of a camera (`normalised_name`);
/// 2. by number: it holds the last number of its name, and no two cameras have the same;
/// 3. by order: as many files as cameras, both in natural order; or as many in each folder; or as many of each name.
/// All files are those of a single camera, each in a sequence of its own.
/// Where each camera has a folder, and the files in it have numbers and no name in common with those of the other
/// cameras, as cameras name their files, they belong together in natural order, if all folders have as many.
/// The part of the path, counted from its end, is that by which the sequences have most cameras. A match by number must
/// leave either no file or no camera over, because cameras might be counted from 0 and files from 1.
/// @param paths without extension, with `/` @param cameras their names
CameraMatch match_cameras(const std::vector<std::string>& paths, const std::vector<std::string>& cameras);

/// "by name", "by number" or "by order".
std::string to_string(CameraMatch::Way way);

/// One path with `{name}` or `{camera}` for the files of all cameras, where one fits; else the path of each camera. The
/// files of a single camera are named without placeholder, except for `{frame}`.
/// @param by_camera index of the camera in the calibration -> path, which may hold `{frame}`; not empty
/// @param names of all cameras of the calibration
CameraPaths paths_of_cameras(const std::map<int, std::string>& by_camera, const std::vector<std::string>& names);

}  // namespace doppel
