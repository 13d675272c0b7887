#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

/// Reads one file; every message names the camera and the key.
class SplattingReader {
 public:
  explicit SplattingReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  Calibration read() {
    const nlohmann::json root = read_json(where_.file);
    if (!root.is_array() || root.empty())
      fail_at(where_, "reading a camera calibration: the file must be a list of cameras");
    Calibration calibration;
    calibration.has_scale = false;
    for (const nlohmann::json& item : root)
      calibration.cameras.push_back(read_camera(item, calibration.cameras.size()));
    calibration.notes.emplace_back(
        "the format has no principal points and no distortion; the centres of the images were taken, and the images "
        "must be undistorted");
    return calibration;
  }

 private:
  Camera read_camera(const nlohmann::json& item, std::size_t index) {
    if (!item.is_object()) fail_at(where_, "reading a camera calibration: camera {} must be an object", index);
    Camera camera;
    camera.name = name_of(item, index);
    const std::string what = fmt::format("camera {}: ", camera.name);
    const auto list = [&](const char* key, std::size_t count) {
      return numbers(item.value(key, nlohmann::json()), count, what + key, where_);
    };
    const auto value = [&](const char* key) { return number(item, key, what + key, where_); };
    camera.width = image_side(value("width"), what + "width", where_);
    camera.height = image_side(value("height"), what + "height", where_);
    camera.K = intrinsics(value("fx"), value("fy"), 0.5 * camera.width, 0.5 * camera.height, PixelCentre::half);
    const std::vector<double> position = list("position", 3);
    set_pose_at(camera, repaired_rotation(matrix_from_rows(list("rotation", 9)).transpose()),
                {position[0], position[1], position[2]});
    return camera;
  }

  /// Images of several folders may have one name, because the program that writes the file drops the folders.
  std::string name_of(const nlohmann::json& item, std::size_t index) {
    const nlohmann::json stored = item.value("img_name", nlohmann::json());
    std::string name = stored.is_string() ? stored.get<std::string>() : fmt::format("camera{}", index);
    while (!names_.insert(name).second) name = fmt::format("{}_{}", name, index);
    return name;
  }

  FileLocation where_;
  std::set<std::string> names_;
};

/// `cameras.json`, which 3D Gaussian Splatting writes beside its result: a list with `img_name`, `width`, `height`,
/// `fx`, `fy`, `position` and `rotation`. `rotation` is the matrix world from camera, with x right, y down and z
/// forward, and `position` the centre of the camera: X_cam = rotation^T (X - position). Unit and axes are those of the
/// scene, as a rule a COLMAP model. There is no principal point: the program assumes the image's centre.
class SplattingCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "gaussian_splatting"; }
  bool recognises(const CalibrationSource& source) const override {
    const std::size_t begin = source.head.find_first_of("[{");
    if (begin == std::string::npos || source.head[begin] != '[') return false;
    const char* const keys[] = {"\"position\"", "\"rotation\"", "\"fx\"", "\"fy\"", "\"width\""};
    return std::all_of(std::begin(keys), std::end(keys), [&](const char* key) { return source.has(key); });
  }
  Calibration read(const CalibrationSource& source) const override { return SplattingReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_gaussian_splatting_calibration() {
  return std::make_unique<SplattingCalibration>();
}

}  // namespace doppel
