#pragma once

#include <ATen/Parallel.h>

#include <algorithm>
#include <opencv2/core.hpp>

namespace doppel {

/// Reduces the threads of LibTorch and OpenCV by one in its scope, to leave a core to the threads that read images.
/// Parallel regions with as many threads as cores would wait for each other: on two cores a clip of 540 x 960 pixels
/// is tracked at 42 frames/s with two threads in each region, and at 58 with one.
class OneThreadFewer {
 public:
  OneThreadFewer() : before_(at::get_num_threads()), before_opencv_(cv::getNumThreads()) {
    at::set_num_threads(std::max(1, before_ - 1));
    cv::setNumThreads(std::max(1, before_opencv_ - 1));
  }
  ~OneThreadFewer() {
    at::set_num_threads(before_);
    cv::setNumThreads(before_opencv_);
  }
  OneThreadFewer(const OneThreadFewer&) = delete;
  OneThreadFewer& operator=(const OneThreadFewer&) = delete;

 private:
  int before_, before_opencv_;
};

}  // namespace doppel
