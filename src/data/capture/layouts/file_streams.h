#pragma once

#include <string>
#include <vector>

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

/// Groups paths into streams. Images and JSON files of a folder whose names hold times are one stream, the folder, if
/// it has no others. Images and JSON files of a folder whose names differ in numbers alone are files per
/// frame: the number with most values counts the frames, the last of several such, and one behind "cam" or "view" only
/// where no other number varies. A folder per frame: frame_folders.h. Videos and tables are streams of their own. Paths
/// with braces are left out: a capture.yaml cannot name them.
/// @param per_frame false: every file is a stream of its own
/// @return in natural order of their first files
std::vector<FileStream> group_streams(const std::vector<std::string>& paths, bool per_frame = true);

}  // namespace doppel
