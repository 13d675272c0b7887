#include <fmt/ranges.h>

#include <map>
#include <nlohmann/json.hpp>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kPanopticMetresPerUnit = 0.01;

/// Reads one file; every message names the camera and the key.
class PanopticReader {
 public:
  explicit PanopticReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  Calibration read() {
    const nlohmann::json root = read_json(where_.file);
    const nlohmann::json list = root.is_object() ? root.value("cameras", nlohmann::json()) : nlohmann::json();
    if (!list.is_array() || list.empty())
      fail_at(where_, "reading a camera calibration: \"cameras\" must be a list of cameras");
    Calibration calibration;
    calibration.unit = "cm";
    calibration.up = "-y";
    for (const nlohmann::json& item : list) calibration.cameras.push_back(read_camera(item));
    if (counts_.size() > 1) calibration.notes.emplace_back(sentence_about_types());
    return calibration;
  }

 private:
  Camera read_camera(const nlohmann::json& item) {
    if (!item.is_object()) fail_at(where_, "reading a camera calibration: \"cameras\" must hold objects");
    Camera camera;
    camera.name = text(item, "name", "a camera");
    const std::string what = "camera " + camera.name;
    ++counts_[text(item, "type", what)];
    const std::vector<double> size = list(item, "resolution", 2, what);
    camera.width = image_side(size[0], what + ": resolution", where_);
    camera.height = image_side(size[1], what + ": resolution", where_);
    camera.K = intrinsics(list(item, "K", 9, what), PixelCentre::integer, where_);
    set_distortion(camera, Lens::opencv, list(item, "distCoef", 0, what), where_);
    camera.R = repaired_rotation(matrix_from_rows(list(item, "R", 9, what)));
    const std::vector<double> t = list(item, "t", 3, what);
    camera.t = kPanopticMetresPerUnit * Eigen::Vector3d(t[0], t[1], t[2]);
    return camera;
  }

  std::string sentence_about_types() const {
    std::vector<std::string> parts;
    for (const auto& [type, count] : counts_) parts.push_back(fmt::format("{} {}", count, type));
    return fmt::format("the file holds cameras of several types ({}); name those that have videos",
                       fmt::join(parts, ", "));
  }

  std::string text(const nlohmann::json& item, const char* key, const std::string& what) const {
    const nlohmann::json value = item.value(key, nlohmann::json());
    if (!value.is_string()) fail_at(where_, "reading a camera calibration: {}: {} must be a text", what, key);
    return value.get<std::string>();
  }

  std::vector<double> list(const nlohmann::json& item, const char* key, std::size_t count,
                           const std::string& what) const {
    return numbers(item.value(key, nlohmann::json()), count, fmt::format("{}: {}", what, key), where_);
  }

  FileLocation where_;
  std::map<std::string, int> counts_;  // of cameras by type
};

/// `calibration_<sequence>.json` of the CMU Panoptic Studio, as its toolbox reads it: X_cam = R X + t, t in
/// centimetres, the world's y points down, `distCoef` is k1 k2 p1 p2 k3 of OpenCV. The centre of the first pixel is
/// taken to be (0, 0), as in OpenCV. Whole files hold 480 vga, 31 hd and 10 Kinect cameras with images of different
/// sizes. All are read, because only the user knows which videos were downloaded.
class PanopticCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "panoptic"; }
  bool recognises(const CalibrationSource& source) const override {
    return source.has("\"cameras\"") && source.has("\"distCoef\"") && source.has("\"resolution\"");
  }
  Calibration read(const CalibrationSource& source) const override { return PanopticReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_panoptic_calibration() { return std::make_unique<PanopticCalibration>(); }

}  // namespace doppel
