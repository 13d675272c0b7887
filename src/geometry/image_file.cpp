#include "doppel/geometry/image_file.h"

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {

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
