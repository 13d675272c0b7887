#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "doppel/calibration/camera_parts.h"
#include "doppel/calibration/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kMaxOpenCvBytes = 256 << 20;

bool starts_with(const std::string& text, const char* begin) { return text.rfind(begin, 0) == 0; }

/// Reads the nodes of one file; every message begins with the file and names the node.
class OpenCvReader {
 public:
  explicit OpenCvReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  /// @param unit receives the unit of the file
  std::vector<Camera> read(std::string& unit) {
    std::string text = read_file(where_.file, kMaxOpenCvBytes);
    if (text.find('\0') != std::string::npos)
      fail_at(where_, "reading a camera calibration: this is not a text file (found a NUL byte)");
    refuse_deep_lists(text, where_);
    text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
    if (starts_with(text, "\xEF\xBB\xBF")) text.erase(0, 3);
    try {
      const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
      return read_cameras(storage.root(), unit);
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
  std::vector<Camera> read_cameras(const cv::FileNode& root, std::string& unit) const {
    const double metres_per_unit = read_unit(root["units"]);
    unit = metres_per_unit == 1 ? "m" : "mm";
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
    if (!node["dist"].empty() || !node["lens"].empty())
      set_distortion(camera, read_lens(node["lens"], key), matrix(node, key, "dist", 0), where_);
    return camera;
  }

  Lens read_lens(const cv::FileNode& node, const std::string& key) const {
    if (node.empty()) return Lens::opencv;
    const std::string found = node.isString() ? node.string() : "";
    for (const Lens lens : {Lens::opencv, Lens::fisheye, Lens::polynomial})
      if (found == lens_name(lens)) return lens;
    fail_at(where_, "reading a camera calibration: {}.lens is \"{}\", allowed are opencv, fisheye and polynomial", key,
            found);
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

/// The coefficients: eight, which OpenCV's own functions take, or all of them if the others are not 0.
cv::Mat coefficients(const Camera& camera) {
  const auto& all = camera.distortion;
  const bool few = std::all_of(all.begin() + 8, all.end(), [](double k) { return k == 0.0; });
  const int count = camera.lens == Lens::fisheye ? 4 : camera.lens == Lens::polynomial ? 6 : few ? 8 : 14;
  return cv::Mat(count, 1, CV_64F, const_cast<double*>(all.data())).clone();
}

/// Doppel's own file in OpenCV's FileStorage (YAML, XML or JSON): one mapping per camera with `width height K dist R
/// t`, and perhaps `name` and `lens` (opencv, fisheye or polynomial). X_cam = R X + t. Without `name`, node `cam7` is
/// camera "7". Metres unless a node `units` says `millimetres`; `pixel_centre: 0` puts the first pixel's centre at 0.
class OpenCvCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "opencv"; }
  bool recognises(const CalibrationSource& source) const override {
    const std::string& head = source.head;
    const std::size_t begin = head.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
    const std::size_t text = head.find_first_not_of(" \t\r\n", begin);
    if (text == std::string::npos) return false;
    if (head.compare(text, 5, "%YAML") == 0) return true;
    if (head.compare(text, 5, "<?xml") == 0) return head.find("<opencv_storage") != std::string::npos;
    return head[text] == '{' && head.find("\"K\"") != std::string::npos && head.find("\"R\"") != std::string::npos;
  }
  bool can_write() const override { return true; }
  bool is_default_for(const std::string& extension) const override {
    return extension == ".yml" || extension == ".yaml" || extension == ".json" || extension == ".xml";
  }
  Calibration read(const CalibrationSource& source) const override {
    Calibration calibration;
    calibration.unit = "m";
    calibration.up = "+y";
    calibration.cameras = OpenCvReader(source.path).read(calibration.unit);
    return calibration;
  }

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
        if (camera.lens != Lens::opencv) storage << "lens" << lens_name(camera.lens);
        storage << "dist" << coefficients(camera);
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
