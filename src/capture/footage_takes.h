#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "doppel/capture/camera_match.h"
#include "doppel/capture/file_streams.h"

namespace doppel {

/// Files of several cameras that belong together.
struct Take {
  std::string name;             ///< its words (`take_name`), may be empty
  std::set<std::string> words;  ///< the same, without order
  std::map<int, FileStream> by_camera;

  std::map<int, std::string> paths() const;
};

/// Streams, sorted into takes.
struct Takes {
  CameraMatch::Way way = CameraMatch::Way::none;
  std::vector<Take> takes;             ///< in the order of their first files
  std::vector<std::string> unmatched;  ///< paths for which no camera was found, or which another file of the same
                                       ///< camera and take came before
  std::size_t most_cameras() const;
};

Takes find_takes(const std::vector<FileStream>& streams, const std::vector<std::string>& cameras);

/// The take whose words include those of a sequence, with fewest other words; null when there is none, or two.
/// @param only whether there is one sequence: then the only take belongs to it
const Take* take_of_sequence(const Take& sequence, const Takes& takes, bool only);

}  // namespace doppel
