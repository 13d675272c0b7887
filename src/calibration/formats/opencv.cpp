#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/file_storage.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"

namespace doppel {
namespace {

bool starts_with(const std::string& text, const char* begin) { return text.rfind(begin, 0) == 0; }

/// Reads the nodes of one file; every message begins with the file and names the node.
class OpenCvReader {
 public:
  explicit OpenCvReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  /// @param calibration receives cameras and unit, and whether the cameras have poses
  void read(Calibration& calibration) const {
    const StorageValue root = read_file_storage(where_.file);
    calibration.has_poses = have_poses(root);
    calibration.cameras = read_cameras(root, calibration.has_poses, calibration.unit);
    if (!calibration.has_poses) calibration.notes.emplace_back("the cameras have no R and t, so there are no poses");
  }

 private:
  /// A file of intrinsics has neither R nor t; one camera with a pose means that all must have one.
  static bool have_poses(const StorageValue& root) {
    bool any_camera = false;
    for (const auto& [key, node] : root.members) {
      if (!node.is_mapping()) continue;
      any_camera = true;
      if (!node["R"].is_none() || !node["t"].is_none()) return true;
    }
    return !any_camera;
  }

  std::vector<Camera> read_cameras(const StorageValue& root, bool with_poses, std::string& unit) const {
    const double metres_per_unit = read_unit(root["units"]);
    unit = metres_per_unit == 1 ? "m" : "mm";
    const double pixel_centre = root["pixel_centre"].is_none() ? 0.5 : number(root["pixel_centre"], "pixel_centre");
    if (pixel_centre != 0 && pixel_centre != 0.5) {
      fail_at(where_, "reading a camera calibration: pixel_centre is {}, allowed are 0 and 0.5", pixel_centre);
    }
    std::vector<Camera> cameras;
    for (const auto& [key, node] : root.members) {
      if (!node.is_mapping()) continue;
      cameras.push_back(read_camera(key, node));
      if (with_poses) read_pose(cameras.back(), key, node, metres_per_unit);
      cameras.back().K(0, 2) += 0.5 - pixel_centre;
      cameras.back().K(1, 2) += 0.5 - pixel_centre;
    }
    const StorageValue& count = root["count"];
    if (!count.is_none() && number(count, "count") != static_cast<double>(cameras.size())) {
      fail_at(where_, "reading a camera calibration: \"count\" promises {} cameras, found {}; is the file truncated?",
              number(count, "count"), cameras.size());
    }
    return cameras;
  }

  double read_unit(const StorageValue& node) const {
    if (node.is_none()) return 1;
    const std::string& unit = node.text;
    if (unit == "metres" || unit == "meters" || unit == "m") return 1;
    if (unit == "millimetres" || unit == "millimeters" || unit == "mm") return 0.001;
    fail_at(where_, "reading a camera calibration: \"units\" is \"{}\", allowed are metres and millimetres",
            excerpt(unit));
  }

  Camera read_camera(const std::string& written_key, const StorageValue& node) const {
    const std::string key = excerpt(written_key);
    Camera camera;
    camera.name = read_name(written_key, node);
    camera.width = side(node, key, "width");
    camera.height = side(node, key, "height");
    const std::vector<double> K = matrix(node, key, "K", 9);
    camera.K = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(K.data());
    if (!node["dist"].is_none() || !node["lens"].is_none())
      set_distortion(camera, read_lens(node["lens"], key), matrix(node, key, "dist", 0), where_);
    return camera;
  }

  void read_pose(Camera& camera, const std::string& written_key, const StorageValue& node,
                 double metres_per_unit) const {
    const std::string key = excerpt(written_key);
    const std::vector<double> R = matrix(node, key, "R", 9), t = matrix(node, key, "t", 3);
    camera.R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data());
    camera.t = Eigen::Map<const Eigen::Vector3d>(t.data()) * metres_per_unit;
  }

  Lens read_lens(const StorageValue& node, const std::string& key) const {
    if (node.is_none()) return Lens::opencv;
    const std::string& found = node.text;
    for (const Lens lens : {Lens::opencv, Lens::fisheye, Lens::polynomial})
      if (found == lens_name(lens)) return lens;
    fail_at(where_, "reading a camera calibration: {}.lens is \"{}\", allowed are opencv, fisheye and polynomial", key,
            excerpt(found));
  }

  /// The name of a camera in other files: its `name`, else the number in `cam<number>`, else the key.
  static std::string read_name(const std::string& key, const StorageValue& node) {
    const StorageValue& name = node["name"];
    if (name.kind == StorageValue::Kind::integer) return std::to_string(static_cast<int>(name.number));
    if (!name.text.empty()) return name.text;  // OpenCV writes the name "nan" without quotation marks
    const bool numbered =
        key.size() > 3 && starts_with(key, "cam") && key.find_first_not_of("0123456789", 3) == std::string::npos;
    return numbered ? key.substr(3) : key;
  }

  double number(const StorageValue& node, const std::string& what) const {
    if (!node.is_number()) fail_at(where_, "reading a camera calibration: {} must be a number", what);
    if (!std::isfinite(node.number)) fail_at(where_, "reading a camera calibration: {} must be finite", what);
    return node.number;
  }

  int side(const StorageValue& node, const std::string& key, const char* what) const {
    const StorageValue& side = node[what];
    if (side.kind != StorageValue::Kind::integer)
      fail_at(where_, "reading a camera calibration: {}.{} must be an integer{}", key, what,
              side.is_none() ? ", it is missing" : "");
    return static_cast<int>(side.number);
  }

  std::vector<double> matrix(const StorageValue& parent, const std::string& key, const char* what,
                             std::size_t expected) const {
    const std::string name = fmt::format("{}.{}", key, what);
    std::vector<double> values = parent[what].numbers(name, where_);
    if (expected != 0 && values.size() != expected)
      fail_at(where_, "reading a camera calibration: {} holds {} numbers, expected {}", name, values.size(), expected);
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
/// camera "7". A file whose cameras all lack R and t holds intrinsics alone. Metres unless a node `units` says
/// `millimetres`; `pixel_centre: 0` puts the first pixel's centre at 0.
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
    const auto has = [&](const char* key) { return head.find(key) != std::string::npos; };
    return head[text] == '{' && has("\"K\"") && (has("\"R\"") || has("\"pixel_centre\""));
  }
  bool can_write() const override { return true; }
  bool is_default_for(const std::string& extension) const override {
    return extension == ".yml" || extension == ".yaml" || extension == ".json" || extension == ".xml";
  }
  Calibration read(const CalibrationSource& source) const override {
    Calibration calibration;
    calibration.unit = "m";
    calibration.up = "+y";
    OpenCvReader(source.path).read(calibration);
    return calibration;
  }

  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    write_storage(path, cameras, true);
  }
  void write_intrinsics(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    write_storage(path, cameras, false);
  }

 private:
  static void write_storage(const std::filesystem::path& path, const std::vector<Camera>& cameras, bool with_poses) {
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
        if (with_poses) storage << "R" << row_major(camera.R) << "t" << row_major(camera.t);
        storage << "}";
      }
    } catch (const cv::Exception& e) {
      fail("writing a camera calibration: {}", e.err);
    }
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_opencv_calibration() { return std::make_unique<OpenCvCalibration>(); }

}  // namespace doppel
