#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "doppel/detect/keypoints/format.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The keypoint files of one camera in one sequence, in any supported format.
class KeypointSource {
 public:
  /// @param path a file per frame when it holds `{frame}`, or when it is a folder with several .json files, whose
  ///             frames are the last numbers in their names (frame_names.h); else one file of all frames, or a folder
  ///             with one
  /// @param offset number that the files have of frame 0
  /// @throws FileError when the file of all frames cannot be read, or the folder has no .json file
  KeypointSource(std::string path, const PointLayout& layout, const KeypointCamera& camera, long offset);

  /// All people in a frame; nothing when the file of this frame is missing. @throws FileError as read_people
  std::optional<People> people(long frame) const;

  /// The first and the last frame of which one file of all frames, or a folder, tells anything; nothing for a path with
  /// `{frame}`, and where there is none.
  std::optional<std::pair<long, long>> range() const;

 private:
  std::string path_;
  PointLayout layout_;
  KeypointCamera camera_;
  long offset_;
  std::map<long, std::filesystem::path> files_;  ///< of a folder
  std::optional<std::map<long, People>> all_;
};

/// What KeypointSource needs of a camera at the resolution of its images. @param index position in the calibration
KeypointCamera keypoint_camera(const Camera& camera, int index);

/// The .json files of a folder by frame. @throws FileError when there is none
std::map<long, std::filesystem::path> keypoint_files_of_folder(const std::filesystem::path& folder);

}  // namespace doppel
