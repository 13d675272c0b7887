#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "doppel/data/capture/layouts/camera_match.h"
#include "doppel/data/capture/layouts/file_streams.h"

namespace doppel {

/// Files of several cameras that belong together.
struct SequenceFiles {
  std::string name;             ///< its words (`telling_name`), may be empty
  std::set<std::string> words;  ///< the same, without order
  std::map<int, FileStream> by_camera;

  std::map<int, std::string> paths() const;
};

/// Streams, sorted into sequences.
struct SortedFiles {
  CameraMatch::Way way = CameraMatch::Way::none;
  std::vector<SequenceFiles> sequences;  ///< in the order of their first files
  std::vector<std::string> unmatched;    ///< paths for which no camera was found, or which another file of the same
                                         ///< camera and sequence came before
  std::size_t most_cameras() const;
};

SortedFiles sort_files(const std::vector<FileStream>& streams, const std::vector<std::string>& cameras);

/// Of files in another role (masks, keypoints), those of a sequence: their words include the words of the sequence,
/// with fewest others. Null when there are none, or two such.
/// @param only whether there is one sequence: then files that are sorted into one sequence belong to it
const SequenceFiles* files_of_sequence(const SequenceFiles& sequence, const SortedFiles& files, bool only);

}  // namespace doppel
