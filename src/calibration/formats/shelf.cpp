#include <algorithm>
#include <nlohmann/json.hpp>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kShelfMetresPerUnit = 0.001;

/// Reads one file; every message names the camera and the key.
class ShelfReader {
 public:
  explicit ShelfReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  Calibration read() const {
    const nlohmann::json root = read_json(where_.file);
    if (!root.is_object() || root.empty())
      fail_at(where_, "reading a camera calibration: the file must be an object with one entry per camera");
    std::vector<std::string> names;
    for (const auto& [name, camera] : root.items()) names.push_back(name);
    // The names are numbers: camera 10 comes after camera 9.
    std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
      return a.size() != b.size() ? a.size() < b.size() : a < b;
    });
    Calibration calibration;
    calibration.unit = "mm";
    calibration.up = "+z";
    for (const std::string& name : names) calibration.cameras.push_back(read_camera(name, root[name]));
    return calibration;
  }

 private:
  Camera read_camera(const std::string& name, const nlohmann::json& item) const {
    const std::string what = "camera " + name + ": ";
    if (!item.is_object()) fail_at(where_, "reading a camera calibration: {}must be an object", what);
    Camera camera;
    camera.name = name;
    const auto list = [&](const char* key, std::size_t count) {
      return numbers(item.value(key, nlohmann::json()), count, what + key, where_);
    };
    const auto value = [&](const char* key) { return number(item, key, what + key, where_); };
    camera.K = intrinsics(value("fx"), value("fy"), value("cx"), value("cy"), PixelCentre::integer);
    const std::vector<double> k = list("k", 3), p = list("p", 2), T = list("T", 3);
    set_distortion(camera, Lens::opencv, std::vector<double>{k[0], k[1], p[0], p[1], k[2]}, where_);
    set_pose_at(camera, matrix_from_rows(list("R", 9)), kShelfMetresPerUnit * Eigen::Vector3d(T[0], T[1], T[2]));
    return camera;
  }

  FileLocation where_;
};

/// The JSON calibration of the Shelf and Campus data sets as VoxelPose and MMPose distribute it: an object with one
/// entry per camera, which holds fx, fy, cx, cy, k (k1 k2 k3), p (p1 p2), R and T. T is the centre of the camera in
/// millimetres, not a translation: X_cam = R (X - T). The world's z points up. The centre of the first pixel is taken
/// to be (0, 0), as in OpenCV. The size of the images is not in the file.
class ShelfCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "shelf"; }
  bool recognises(const CalibrationSource& source) const override {
    const char* const keys[] = {"\"fx\"", "\"fy\"", "\"cx\"", "\"cy\"", "\"k\"", "\"p\"", "\"R\"", "\"T\""};
    return std::all_of(std::begin(keys), std::end(keys), [&](const char* key) { return source.has(key); });
  }
  Calibration read(const CalibrationSource& source) const override { return ShelfReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_shelf_calibration() { return std::make_unique<ShelfCalibration>(); }

}  // namespace doppel
