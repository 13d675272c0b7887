#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/geometry/calibration_formats.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kMaxOpenCvBytes = 256 << 20;

bool starts_with(const std::string& text, const char* begin) { return text.rfind(begin, 0) == 0; }

/// Reads the nodes of one file; every message begins with the file and names the node.
class OpenCvReader {
 public:
  explicit OpenCvReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  std::vector<Camera> read() {
    std::string text = read_file(where_.file, kMaxOpenCvBytes);
    if (text.find('\0') != std::string::npos)
      fail_at(where_, "reading a camera calibration: this is not a text file (found a NUL byte)");
    text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
    if (starts_with(text, "\xEF\xBB\xBF")) text.erase(0, 3);
    try {
      const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
      return read_cameras(storage.root());
    } catch (const Error&) {
      throw;
    } catch (const cv::Exception& e) {
      fail_at(where_, "reading a camera calibration: OpenCV cannot read this file: {}", e.err);
    } catch (const std::exception& e) {
      // OpenCV's parser also throws exceptions of the standard library, for example for an empty key.
      fail_at(where_, "reading a camera calibration: OpenCV cannot read this file: {}", e.what());
    }
  }

 private:
  std::vector<Camera> read_cameras(const cv::FileNode& root) const {
    const double metres_per_unit = read_unit(root["units"]);
    const double pixel_centre = root["pixel_centre"].empty() ? 0.5 : number(root["pixel_centre"], "pixel_centre");
    if (pixel_centre != 0 && pixel_centre != 0.5) {
      fail_at(where_, "reading a camera calibration: pixel_centre is {}, allowed are 0 and 0.5", pixel_centre);
    }
    std::vector<Camera> cameras;
    for (const cv::FileNode& node : root) {
      if (!node.isMap()) continue;
      cameras.push_back(read_camera(node, metres_per_unit));
      cameras.back().K(0, 2) += 0.5 - pixel_centre;
      cameras.back().K(1, 2) += 0.5 - pixel_centre;
    }
    const cv::FileNode count = root["count"];
    if (!count.empty() && number(count, "count") != static_cast<double>(cameras.size())) {
      fail_at(where_, "reading a camera calibration: \"count\" promises {} cameras, found {}; is the file truncated?",
              number(count, "count"), cameras.size());
    }
    return cameras;
  }

  double read_unit(const cv::FileNode& node) const {
    if (node.empty()) return 1;
    const std::string unit = node.isString() ? node.string() : "";
    if (unit == "metres" || unit == "meters" || unit == "m") return 1;
    if (unit == "millimetres" || unit == "millimeters" || unit == "mm") return 0.001;
    fail_at(where_, "reading a camera calibration: \"units\" is \"{}\", allowed are metres and millimetres", unit);
  }

  Camera read_camera(const cv::FileNode& node, double metres_per_unit) const {
    const std::string key = node.name();
    Camera camera;
    camera.name = read_name(node);
    camera.width = side(node, key, "width");
    camera.height = side(node, key, "height");
    const std::vector<double> K = matrix(node, key, "K", 9), R = matrix(node, key, "R", 9),
                              t = matrix(node, key, "t", 3);
    camera.K = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(K.data());
    camera.R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data());
    camera.t = Eigen::Map<const Eigen::Vector3d>(t.data()) * metres_per_unit;
    if (!node["dist"].empty()) {
      const std::vector<double> dist = matrix(node, key, "dist", 0);
      if (dist.size() != 4 && dist.size() != 5 && dist.size() < 8) {
        fail_at(where_, "reading a camera calibration: {}.dist has {} coefficients, allowed are 4, 5 or 8", key,
                dist.size());
      }
      for (std::size_t i = 8; i < dist.size(); ++i) {
        if (dist[i] != 0)
          fail_at(where_, "reading a camera calibration: {}.dist has {} coefficients, of which Doppel knows 8", key,
                  dist.size());
      }
      std::copy_n(dist.begin(), std::min<std::size_t>(8, dist.size()), camera.distortion.begin());
    }
    return camera;
  }

  /// The name of a camera in other files: its `name`, else the number in `cam<number>`, else the key.
  std::string read_name(const cv::FileNode& node) const {
    const cv::FileNode name = node["name"];
    if (name.isString()) return name.string();
    if (name.isInt()) return std::to_string(static_cast<int>(name));
    const std::string key = node.name();
    const bool numbered =
        key.size() > 3 && starts_with(key, "cam") && key.find_first_not_of("0123456789", 3) == std::string::npos;
    return numbered ? key.substr(3) : key;
  }

  double number(const cv::FileNode& node, const std::string& what) const {
    if (!node.isInt() && !node.isReal()) fail_at(where_, "reading a camera calibration: {} must be a number", what);
    const double value = node.real();
    if (!std::isfinite(value)) fail_at(where_, "reading a camera calibration: {} must be finite", what);
    return value;
  }

  int side(const cv::FileNode& node, const std::string& key, const char* what) const {
    const cv::FileNode side = node[what];
    if (!side.isInt())
      fail_at(where_, "reading a camera calibration: {}.{} must be an integer{}", key, what,
              side.empty() ? ", it is missing" : "");
    return static_cast<int>(side);
  }

  /// Read item by item, because cv::Mat would allocate any size that `rows` and `cols` state.
  std::vector<double> matrix(const cv::FileNode& parent, const std::string& key, const char* what,
                             std::size_t expected) const {
    const cv::FileNode node = parent[what];
    const cv::FileNode data = node.isMap() ? node["data"] : node;
    if (!data.isSeq())
      fail_at(where_, "reading a camera calibration: {}.{} must be a matrix{}", key, what,
              node.empty() ? ", it is missing" : "");
    const auto found = data.size();
    const bool promised = !node.isMap() || number(node["rows"], key + ".rows") * number(node["cols"], key + ".cols") ==
                                               static_cast<double>(found);
    if (!promised || (expected && found != expected) || found > 64) {
      fail_at(where_, "reading a camera calibration: {}.{} holds {} numbers, expected {}", key, what, found,
              expected ? std::to_string(expected) : "rows x cols");
    }
    std::vector<double> values;
    for (const cv::FileNode& item : data) values.push_back(number(item, fmt::format("{}.{}", key, what)));
    return values;
  }

  FileLocation where_;
};

template <typename Derived>
cv::Mat row_major(const Eigen::MatrixBase<Derived>& matrix) {
  cv::Mat copy(static_cast<int>(matrix.rows()), static_cast<int>(matrix.cols()), CV_64F);
  for (int row = 0; row < copy.rows; ++row) {
    for (int col = 0; col < copy.cols; ++col) copy.at<double>(row, col) = matrix(row, col);
  }
  return copy;
}

class OpenCvCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "OpenCV FileStorage"; }
  bool recognises(const std::string& head) const override {
    const std::size_t begin = head.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
    const std::size_t text = head.find_first_not_of(" \t\r\n", begin);
    if (text == std::string::npos) return false;
    return head.compare(text, 5, "%YAML") == 0 || head.compare(text, 5, "<?xml") == 0 || head[text] == '{';
  }
  bool writes(const std::string& extension) const override {
    return extension == ".yml" || extension == ".yaml" || extension == ".json" || extension == ".xml";
  }
  std::vector<Camera> read(const std::filesystem::path& path) const override { return OpenCvReader(path).read(); }

  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    try {
      cv::FileStorage storage(path.string(), cv::FileStorage::WRITE);
      if (!storage.isOpened()) fail("writing {}: OpenCV cannot open it", path.string());
      storage << "units"
              << "metres"
              << "pixel_centre" << 0.5 << "count" << static_cast<int>(cameras.size());
      for (std::size_t i = 0; i < cameras.size(); ++i) {
        const Camera& camera = cameras[i];
        storage << "cam" + std::to_string(i) << "{";
        storage << "name" << camera.name << "width" << camera.width << "height" << camera.height;
        storage << "K" << row_major(camera.K);
        storage << "dist" << cv::Mat(8, 1, CV_64F, const_cast<double*>(camera.distortion.data()));
        storage << "R" << row_major(camera.R) << "t" << row_major(camera.t) << "}";
      }
    } catch (const cv::Exception& e) {
      fail("writing a camera calibration: {}", e.err);
    }
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_opencv_calibration() { return std::make_unique<OpenCvCalibration>(); }

}  // namespace doppel
