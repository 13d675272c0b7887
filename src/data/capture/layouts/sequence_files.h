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

/// Whether files belong to a sequence by their telling words: they include those of the sequence, and those of no other
/// sequence that has more words, or as many in the order of the files. "walk_fast" does not belong to "walk" where
/// there is a sequence "walk_fast", and "s1_t2" not to "s2_t1".
/// @param sequence index in `filmed` @param name, words of the files (telling_name, telling_words)
bool belong_to(std::size_t sequence, const std::vector<SequenceFiles>& filmed, const std::string& name,
               const std::set<std::string>& words);

/// Of files in another role (masks, keypoints), those of a sequence: that belong to it, with fewest other words. The
/// only files belong to the only sequence, unless their words differ in numbers alone (take1, take2). Null when there
/// are none, or two such.
const SequenceFiles* files_of_sequence(std::size_t sequence, const std::vector<SequenceFiles>& filmed,
                                       const SortedFiles& files);

}  // namespace doppel
