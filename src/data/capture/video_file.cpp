#include "doppel/data/capture/video_file.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/temporary_name.h"

namespace doppel {

namespace fs = std::filesystem;

void finish_video(cv::VideoWriter& writer, const fs::path& file, long frames) {
  writer.release();
  cv::VideoCapture written;
  bool opened = false;
  try {
    opened = written.open(file.string());
  } catch (const cv::Exception&) {
    // a backend may throw an exception for a damaged file instead of returning false
  }
  const long found = opened ? static_cast<long>(written.get(cv::CAP_PROP_FRAME_COUNT)) : 0;
  if (found != frames)
    fail("writing {}: of {} images, {} are in the video; is the disk full?", file.string(), frames,
         std::max(0L, found));
}

VideoFile::VideoFile(const fs::path& path, cv::Size size, double frames_per_second)
    : path_(path), temporary_(temporary_beside(path)) {
  writer_.open(temporary_.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), frames_per_second, size);
  if (writer_.isOpened()) return;
  discard();
  fail(
      "opening {} for writing: the file cannot be made, or this OpenCV build has no encoder for MPEG-4 video; see that "
      "its folder exists and the disk is not full",
      path_.string());
}

VideoFile::~VideoFile() {
  if (!temporary_.empty()) discard();
}

void VideoFile::discard() {
  writer_.release();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void VideoFile::write(const cv::Mat& image) {
  writer_.write(image);
  ++frames_;
}

void VideoFile::close() {
  finish_video(writer_, temporary_, frames_);
  publish_file(temporary_, path_);
  temporary_.clear();
}

}  // namespace doppel
