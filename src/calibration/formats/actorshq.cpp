#include <algorithm>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/camera.h"

namespace doppel {
namespace {

constexpr const char* kActorsHqHeader = "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py";
constexpr std::size_t kActorsHqColumns = 13;

Camera read_actorshq_row(const TextReader& row) {
  const auto value = [&](std::size_t column, const char* what) {
    return row.number(column, fmt::format("{} of camera {}", what, row.tokens()[0]));
  };
  Camera camera;
  camera.name = std::string(row.tokens()[0]);
  if (camera.name.empty()) row.fail_here("reading a camera calibration: the name of a camera is missing");
  camera.width = static_cast<int>(row.integer(1, "w", 1, kMaxImageSide));
  camera.height = static_cast<int>(row.integer(2, "h", 1, kMaxImageSide));
  const Eigen::Vector3d turn(value(3, "rx"), value(4, "ry"), value(5, "rz"));
  const Eigen::Vector3d centre(value(6, "tx"), value(7, "ty"), value(8, "tz"));
  camera.K = intrinsics(value(9, "fx") * camera.width, value(10, "fy") * camera.height, value(11, "px") * camera.width,
                        value(12, "py") * camera.height, PixelCentre::half);
  set_pose_at(camera, rotation_from_vector(turn).transpose(), centre);
  return camera;
}

/// `calibration.csv` of ActorsHQ, as the code of HumanRF reads it: rx ry rz is the rotation vector world from camera,
/// tx ty tz the centre of the camera in metres, X_cam = R^T (X - t), with x right, y down and z forward. fx and px are
/// fractions of the width, fy and py of the height. The images have no distortion. The centre of the first pixel is
/// (0.5, 0.5), where HumanRF sends its rays. The axis that points up is not stated.
class ActorsHqCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "actorshq"; }
  bool recognises(const CalibrationSource& source) const override {
    std::string line = source.head.substr(0, source.head.find('\n'));
    if (line.compare(0, 3, "\xEF\xBB\xBF") == 0) line.erase(0, 3);
    line.erase(std::remove_if(line.begin(), line.end(), [](char c) { return c == ' ' || c == '\t' || c == '\r'; }),
               line.end());
    return line == kActorsHqHeader;
  }
  Calibration read(const CalibrationSource& source) const override {
    TextReader reader(source.path, "a camera calibration", Separator::comma);
    reader.require_header(kActorsHqHeader);
    Calibration calibration;
    calibration.unit = "m";
    while (reader.next_row(kActorsHqColumns)) calibration.cameras.push_back(read_actorshq_row(reader));
    if (calibration.cameras.empty()) reader.fail_here("reading a camera calibration: the table has no cameras");
    return calibration;
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_actorshq_calibration() { return std::make_unique<ActorsHqCalibration>(); }

}  // namespace doppel
