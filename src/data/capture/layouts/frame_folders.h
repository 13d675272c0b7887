#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/layouts/file_stream.h"

namespace doppel {

/// Takes out of `paths` the images and JSON files that lie in one folder per frame, which holds a file of each camera:
/// frames/0007/cam1.png. Most of the folders hold the same names, or the same but for the number of the frame, and
/// - their name has the word "frame", or that of the folder above, and there are more folders than names,
/// - or the names of the files number cameras ("cam1"), or are several without a number,
/// - or there are three times as many folders as names.
/// Names that are but a number count frames themselves, unless one of the first two holds. Folders whose names have a
/// word of cameras, or of takes, are none.
/// @return a stream for each name, `{frame}` in its folder
std::vector<FileStream> take_frame_folders(std::vector<std::string>& paths);

}  // namespace doppel
