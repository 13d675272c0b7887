#pragma once

#include <string>

namespace doppel {

enum class FileKind { video, image, json, table, other };
/// By the extension. Other images and videos than OpenCV reads are `other`.
FileKind kind_of_file(const std::string& path);

/// Files that belong together: those of one camera in one sequence. Either one file, or a file per frame.
struct FileStream {
  FileKind kind = FileKind::other;
  std::string path;        ///< of the file, or with `{frame}` in its name (path_pattern.h)
  std::string first_file;  ///< path of the file, or of the file of the first frame
  long files = 1;
  long first_frame = 0;  ///< frame number of the first file
  long last_frame = 0;   ///< and of the last
  bool per_frame = false;
  bool by_position = false;  ///< the names hold times: `path` is the folder, frames are positions in natural order
  bool alone = false;        ///< a file per frame, and the folder has no other files of this kind
  long step = 1;             ///< from each number in the names to the next; 1 also where they have no common step

  /// The path without extension and frame, in which the names of the camera and of the sequence stand.
  std::string stem() const;
  /// Makes the stream one of its folder, by position. @pre alone
  void count_positions();
};

}  // namespace doppel
