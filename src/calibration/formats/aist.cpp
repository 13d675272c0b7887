#include <algorithm>
#include <nlohmann/json.hpp>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kAistMetresPerUnit = 0.01;

/// Reads one file; every message names the camera and the key.
class AistReader {
 public:
  explicit AistReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  Calibration read() const {
    const nlohmann::json root = read_json(where_.file);
    if (!root.is_array() || root.empty())
      fail_at(where_, "reading a camera calibration: the file must be a list of cameras");
    Calibration calibration;
    calibration.unit = "cm";
    calibration.up = "+y";
    for (const nlohmann::json& item : root) calibration.cameras.push_back(read_camera(item));
    return calibration;
  }

 private:
  Camera read_camera(const nlohmann::json& item) const {
    const nlohmann::json name = item.is_object() ? item.value("name", nlohmann::json()) : nlohmann::json();
    if (!name.is_string()) fail_at(where_, "reading a camera calibration: each camera must have a text \"name\"");
    Camera camera;
    camera.name = name.get<std::string>();
    const auto list = [&](const char* key, std::size_t count) {
      return numbers(item.value(key, nlohmann::json()), count, fmt::format("camera {}: {}", camera.name, key), where_);
    };
    const std::vector<double> size = list("size", 2), r = list("rotation", 3), t = list("translation", 3);
    camera.width = image_side(size[0], fmt::format("camera {}: size", camera.name), where_);
    camera.height = image_side(size[1], fmt::format("camera {}: size", camera.name), where_);
    camera.K = intrinsics(list("matrix", 9), PixelCentre::integer, where_);
    set_distortion(camera, is_fisheye(item) ? Lens::fisheye : Lens::opencv, list("distortions", 0), where_);
    camera.R = rotation_from_vector({r[0], r[1], r[2]});
    camera.t = kAistMetresPerUnit * Eigen::Vector3d(t[0], t[1], t[2]);
    return camera;
  }

  bool is_fisheye(const nlohmann::json& item) const {
    const nlohmann::json flag = item.value("fisheye", nlohmann::json(false));
    if (!flag.is_boolean()) fail_at(where_, "reading a camera calibration: fisheye must be true or false");
    return flag.get<bool>();
  }

  FileLocation where_;
};

/// `setting<n>.json` of AIST++: a list of cameras as aniposelib describes them, with `name`, `size` (width, height),
/// `matrix`, `distortions` (k1 k2 p1 p2 k3; `fisheye`: k1 to k4), `rotation` (Rodrigues) and `translation`:
/// X_cam = R X + t. The file does not name its unit; AIST++ writes centimetres, with y up and the centre of the first
/// pixel at (0, 0).
class AistCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "aist"; }
  bool recognises(const CalibrationSource& source) const override {
    const std::size_t begin = source.head.find_first_of("[{");
    if (begin == std::string::npos || source.head[begin] != '[') return false;
    const char* const keys[] = {"\"name\"", "\"matrix\"", "\"distortions\"", "\"rotation\"", "\"translation\""};
    return std::all_of(std::begin(keys), std::end(keys), [&](const char* key) { return source.has(key); });
  }
  Calibration read(const CalibrationSource& source) const override { return AistReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_aist_calibration() { return std::make_unique<AistCalibration>(); }

}  // namespace doppel
