#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/layouts/file_stream.h"

namespace doppel {

/// Groups paths into streams. Images and JSON files of a folder whose names hold times are one stream, the folder, if
/// it has no others. Images and JSON files of a folder whose names differ in numbers alone are files per
/// frame: the number with most values counts the frames, the last of several such, and one behind "cam" or "view" only
/// where no other number varies. A folder per frame: frame_folders.h. Videos and tables are streams of their own. Paths
/// with braces are left out: a capture.yaml cannot name them.
/// @param per_frame false: every file is a stream of its own
/// @return in natural order of their first files
std::vector<FileStream> group_streams(const std::vector<std::string>& paths, bool per_frame = true);

}  // namespace doppel
