#include "doppel/geometry/image_file.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/geometry/encoded_image.h"
#include "doppel/geometry/image_orientation.h"

namespace doppel {

cv::Mat read_image(const std::filesystem::path& path) {
  const std::string bytes = read_file(path, std::uintmax_t{1} << 30);
  // OpenCV obeys the EXIF data of some formats, in some versions, and never together with an alpha channel.
  const cv::Mat stored = decode_image(bytes, cv::IMREAD_UNCHANGED);
  if (stored.empty())
    fail_at({path.string(), 0}, "is not an image that OpenCV can decode, or has more than {} pixels", kMaxImagePixels);
  return as_shown(stored, exif_orientation(bytes));
}

cv::Mat to_colour(const cv::Mat& image) {
  cv::Mat bytes = image, colour;
  if (image.depth() == CV_16U) image.convertTo(bytes, CV_8U, 1.0 / 257.0);
  if (bytes.channels() == 3) return bytes;
  cv::cvtColor(bytes, colour, bytes.channels() == 4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  return colour;
}

cv::Mat read_colour_image(const std::filesystem::path& path) {
  const cv::Mat image = read_image(path);
  if (image.depth() != CV_8U && image.depth() != CV_16U)
    fail_at({path.string(), 0}, "the image has neither 8 nor 16 bits per channel; save it with 8, for instance as PNG");
  return to_colour(image);
}

void write_image(const std::filesystem::path& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  bool encoded = false;
  try {
    encoded = cv::imencode(path.extension().string(), image, bytes);
  } catch (const cv::Exception&) {
    // an extension that OpenCV does not know
  }
  if (!encoded) fail("writing {}: this image format is not known; allowed are .png and .jpg", path.string());
  write_atomically(path, std::string(bytes.begin(), bytes.end()));
}

}  // namespace doppel
