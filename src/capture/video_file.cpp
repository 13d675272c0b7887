#include "doppel/capture/video_file.h"

#include "doppel/core/error.h"

namespace doppel {

VideoFile::VideoFile(const std::filesystem::path& path, cv::Size size, double frames_per_second)
    : path_(path), temporary_(path.parent_path() / ("." + path.stem().string() + ".part.mp4")) {
  writer_.open(temporary_.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), frames_per_second, size);
  if (!writer_.isOpened())
    fail("opening {} for writing: this OpenCV build has no encoder for MPEG-4 video", path_.string());
}

VideoFile::~VideoFile() {
  if (!writer_.isOpened()) return;
  writer_.release();
  std::error_code ignored;
  std::filesystem::remove(temporary_, ignored);
}

void VideoFile::write(const cv::Mat& image) { writer_.write(image); }

void VideoFile::close() {
  writer_.release();
  std::filesystem::rename(temporary_, path_);
}

}  // namespace doppel
