#include <yaml-cpp/yaml.h>

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

constexpr std::uintmax_t kRosMaxBytes = 1 << 20;

/// Reads one camera_info file; messages name the line and the key.
class RosReader {
 public:
  explicit RosReader(const std::filesystem::path& path) : path_(path) {}

  Calibration read() const {
    const std::string text = read_file(path_, kRosMaxBytes);
    try {
      return read_camera(load_yaml(text));
    } catch (const YAML::Exception& e) {
      fail_at({path_.string(), e.mark.line + 1}, "reading a camera calibration: this is no valid YAML: {}", e.msg);
    }
  }

 private:
  Calibration read_camera(const YAML::Node& root) const {
    if (!root.IsMap()) refuse(root, "expected the keys of a camera_info file");
    Camera camera;
    const YAML::Node name = root["camera_name"];
    camera.name = name && name.IsScalar() && !name.Scalar().empty() ? name.Scalar() : path_.stem().string();
    camera.width = side(root, "image_width");
    camera.height = side(root, "image_height");
    const YAML::Node K = data_of(root, "camera_matrix");
    camera.K = intrinsics(numbers(K, "camera_matrix"), PixelCentre::integer, where(K));
    const YAML::Node distortion = data_of(root, "distortion_coefficients");
    set_distortion(camera, lens(root), numbers(distortion, "distortion_coefficients"), where(distortion));
    Calibration calibration;
    calibration.has_poses = false;
    calibration.cameras.push_back(std::move(camera));
    return calibration;
  }

  Lens lens(const YAML::Node& root) const {
    const YAML::Node node = required(root, "distortion_model");
    const std::string model = node.IsScalar() ? node.Scalar() : "";
    if (model == "plumb_bob" || model == "rational_polynomial") return Lens::opencv;
    if (model == "equidistant" || model == "fisheye") return Lens::fisheye;
    refuse(node, fmt::format("distortion_model is \"{}\", allowed are plumb_bob, rational_polynomial and equidistant",
                             model.substr(0, 40)));
  }

  YAML::Node data_of(const YAML::Node& root, const char* key) const {
    const YAML::Node node = required(root, key);
    const YAML::Node data = node.IsMap() ? node["data"] : node;
    if (!data || !data.IsSequence()) refuse(node, fmt::format("{} must have a list \"data\"", key));
    return data;
  }

  std::vector<double> numbers(const YAML::Node& list, const char* key) const {
    std::vector<double> found;
    for (const YAML::Node& item : list) found.push_back(number(item, key));
    return found;
  }

  double number(const YAML::Node& node, const char* key) const {
    const std::optional<double> value = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (!value || !std::isfinite(*value)) refuse(node, fmt::format("{} must hold finite numbers", key));
    return *value;
  }

  int side(const YAML::Node& root, const char* key) const {
    const YAML::Node node = required(root, key);
    return image_side(number(node, key), key, where(node));
  }

  YAML::Node required(const YAML::Node& root, const char* key) const {
    const YAML::Node node = root[key];
    if (!node) refuse(root, fmt::format("{} is missing", key));
    return node;
  }

  FileLocation where(const YAML::Node& node) const { return {path_.string(), node.Mark().line + 1}; }
  [[noreturn]] void refuse(const YAML::Node& node, const std::string& fault) const {
    fail_at(where(node), "reading a camera calibration: {}", fault);
  }

  std::filesystem::path path_;
};

/// The camera_info YAML of ROS's camera_calibration and camera_info_manager: the intrinsics of one camera.
/// distortion_model plumb_bob (k1 k2 p1 p2 k3) and rational_polynomial (and k4 k5 k6) are OpenCV's lens, equidistant is
/// its fisheye lens; pixel centres are at integers. projection_matrix belongs to rectified images and is not read.
class RosCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "ros_camera_info"; }

  bool recognises(const CalibrationSource& source) const override {
    // OpenCV's calibration files have keys of the same names, but tag their matrices.
    return source.has_line("camera_matrix:") && source.has_line("distortion_model:") && !source.has("opencv-matrix");
  }

  Calibration read(const CalibrationSource& source) const override { return RosReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_ros_calibration() { return std::make_unique<RosCalibration>(); }

}  // namespace doppel
