#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "doppel/detect/blazepose/tflite_model.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

/// Tests of detectors with small networks that see the mean colour of an image.
namespace doppel::support {

/// The network in the bytes of a file (SmallModel).
inline NetworkModel network_of(const std::string& file) {
  const TemporaryFolder folder;
  write_bytes(folder / "small.tflite", file);
  return read_tflite(folder / "small.tflite");
}

/// An image of one colour. @param red, green, blue 0 to 1
inline cv::Mat image_of(double red, double green, double blue) {
  return {50, 60, CV_8UC3, cv::Scalar(255 * blue, 255 * green, 255 * red)};
}

}  // namespace doppel::support
