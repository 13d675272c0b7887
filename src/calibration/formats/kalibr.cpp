#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <string_view>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/load_yaml.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kKalibrMaxBytes = 4 << 20;
constexpr int kKalibrMaxCameras = 1000;

/// Reads one camchain; messages name the line, the camera and the key.
class KalibrReader {
 public:
  explicit KalibrReader(const std::filesystem::path& path) : path_(path) {}

  Calibration read() {
    std::string text = read_file(path_, kKalibrMaxBytes);
    // "%YAML:1.0", which programs that read the file with OpenCV want, is no YAML. As a comment it keeps its line.
    const std::size_t begin = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
    if (text.compare(begin, 5, "%YAML") == 0) text[begin] = '#';
    try {
      read_chain(load_yaml(text));
    } catch (const YAML::Exception& e) {
      fail_at({path_.string(), e.mark.line + 1}, "reading a camera calibration: this is no valid YAML: {}", e.msg);
    }
    return std::move(calibration_);
  }

 private:
  struct Item {
    std::string name;
    YAML::Node node;
    bool has(const char* key) const { return static_cast<bool>(node[key]); }
  };

  void read_chain(const YAML::Node& root) {
    if (!root.IsMap()) refuse(root, "expected the keys cam0, cam1, ...");
    std::vector<Item> items;
    for (int i = 0; i < kKalibrMaxCameras; ++i) {
      const std::string key = fmt::format("cam{}", i);
      const YAML::Node node = root[key];
      if (!node) break;
      if (!node.IsMap()) refuse(node, key + " must be a map");
      items.push_back({key, node});
    }
    check_count(root, items.size());
    calibration_.unit = "m";
    for (const Item& item : items) calibration_.cameras.push_back(read_camera(item));
    set_poses(items);
  }

  void check_count(const YAML::Node& root, std::size_t found) const {
    std::size_t named = 0;
    for (const auto& pair : root) {
      const std::string key = pair.first.IsScalar() ? pair.first.Scalar() : "";
      named += key.size() > 3 && key.starts_with("cam") && key.find_first_not_of("0123456789", 3) == key.npos;
    }
    if (found == 0 || named != found) refuse(root, fmt::format("cam{} is missing", found));
  }

  Camera read_camera(const Item& item) const {
    Camera camera;
    camera.name = item.name;
    const std::string model = word(item, "camera_model");
    if (model != "pinhole") {
      refuse(item.node, fmt::format("{}.camera_model is \"{}\", which Doppel cannot read; allowed is pinhole",
                                    item.name, model.substr(0, 40)));
    }
    const std::vector<double> K = numbers(item, "intrinsics", 4), size = numbers(item, "resolution", 2);
    camera.K = intrinsics(K[0], K[1], K[2], K[3], PixelCentre::integer);
    camera.width = image_side(size[0], item.name + ".resolution", where(item.node["resolution"]));
    camera.height = image_side(size[1], item.name + ".resolution", where(item.node["resolution"]));
    const std::string lens = word(item, "distortion_model");
    if (lens == "none") return camera;
    if (lens != "radtan" && lens != "equidistant") {
      refuse(item.node,
             fmt::format("{}.distortion_model is \"{}\", which Doppel cannot read; allowed are radtan, equidistant and "
                         "none",
                         item.name, lens.substr(0, 40)));
    }
    set_distortion(camera, lens == "radtan" ? Lens::opencv : Lens::fisheye, numbers(item, "distortion_coeffs", 4),
                   where(item.node));
    return camera;
  }

  /// T_cam_imu where all cameras have it, otherwise the chain of T_cn_cnm1 from cam0.
  void set_poses(const std::vector<Item>& items) {
    bool all_have_imu = true, none_has_pose = true;
    for (const Item& item : items) {
      const bool has_imu = item.has("T_cam_imu") || item.has("T_imu_cam");
      all_have_imu = all_have_imu && has_imu;
      none_has_pose = none_has_pose && !has_imu && !item.has("T_cn_cnm1");
    }
    calibration_.has_poses = !none_has_pose;
    if (none_has_pose) return;
    Eigen::Isometry3d camera_from_rig = Eigen::Isometry3d::Identity();
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (all_have_imu) {
        camera_from_rig =
            items[i].has("T_cam_imu") ? transform(items[i], "T_cam_imu") : transform(items[i], "T_imu_cam").inverse();
      } else if (i > 0) {
        camera_from_rig = transform(items[i], "T_cn_cnm1") * camera_from_rig;
      }
      calibration_.cameras[i].R = camera_from_rig.linear();
      calibration_.cameras[i].t = camera_from_rig.translation();
    }
  }

  Eigen::Isometry3d transform(const Item& item, const char* key) const {
    const std::vector<double> values = numbers(item, key, 16);
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(values.data());
    if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
      refuse(item.node[key], fmt::format("the last row of {}.{} must be 0 0 0 1", item.name, key));
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = repaired_rotation(matrix.topLeftCorner<3, 3>());
    pose.translation() = matrix.topRightCorner<3, 1>();
    return pose;
  }

  /// The numbers of a list, or of a list of lists.
  std::vector<double> numbers(const Item& item, const char* key, std::size_t count) const {
    const YAML::Node list = required(item, key);
    const std::string what = fmt::format("{}.{}", item.name, key);
    std::vector<double> found;
    for (const YAML::Node& row : list) {
      if (!row.IsSequence()) found.push_back(number(row, what));
      if (!row.IsSequence()) continue;
      for (const YAML::Node& value : row) found.push_back(number(value, what));
    }
    if (found.size() != count) refuse(list, fmt::format("{} has {} numbers, expected {}", what, found.size(), count));
    return found;
  }

  double number(const YAML::Node& node, const std::string& what) const {
    const std::optional<double> value = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (!value || !std::isfinite(*value)) refuse(node, what + " must hold finite numbers");
    return *value;
  }

  std::string word(const Item& item, const char* key) const {
    const YAML::Node node = required(item, key);
    if (!node.IsScalar()) refuse(node, fmt::format("{}.{} must be a word", item.name, key));
    return node.Scalar();
  }

  YAML::Node required(const Item& item, const char* key) const {
    const YAML::Node node = item.node[key];
    if (!node) refuse(item.node, fmt::format("{}.{} is missing", item.name, key));
    return node;
  }

  FileLocation where(const YAML::Node& node) const { return {path_.string(), node.Mark().line + 1}; }
  [[noreturn]] void refuse(const YAML::Node& node, const std::string& fault) const {
    fail_at(where(node), "reading a camera calibration: {}", fault);
  }

  std::filesystem::path path_;
  Calibration calibration_;
};

/// The camchain YAML of Kalibr: cam0 ... camN with camera_model pinhole, intrinsics fx fy cx cy and distortion_model
/// radtan (OpenCV's first four) or equidistant (OpenCV's fisheye). T_cam_imu goes from the IMU to the camera
/// (T_imu_cam, of OpenVINS, the other way), T_cn_cnm1 from camera n-1 to camera n. Metres; pixel centres are at
/// integers. The world is the IMU or cam0, so no axis points up.
class KalibrCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "kalibr"; }

  bool recognises(const CalibrationSource& source) const override {
    return source.has_line("cam0:") && source.has("camera_model:") && source.has("intrinsics:") &&
           !source.has("opencv-matrix");
  }

  Calibration read(const CalibrationSource& source) const override { return KalibrReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_kalibr_calibration() { return std::make_unique<KalibrCalibration>(); }

}  // namespace doppel
