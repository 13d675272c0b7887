#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/calibration/formats/xml_parts.h"
#include "doppel/core/lower_case.h"

namespace doppel {
namespace {

constexpr double kQualisysMetresPerUnit = 0.001;
// Lengths in the image are in 1/64 pixel, in the files of Theia in pixels. No sensor has this many pixels, or this few
// times 64.
constexpr double kQualisysLargestSensor = 16384;
constexpr double kQualisysPartsOfPixel = 64;
constexpr double kQualisysUpsideDown = -0.25;  // mean of the z of what is up in the images; 0 for cameras on their side

/// A reading of <transform>: rows r11..r33 = M, and x y z = p.
enum class QualisysPose {
  centre,            ///< Qualisys: camera axes x right, y up, z backward in the rows of M; p is the camera's centre
  theia,             ///< Theia: camera axes x right, y down, z forward; X_cam = M X + p
  translation,       ///< camera axes as Qualisys, X_cam = M X + p in these axes
  translation_down,  ///< camera axes as Qualisys, p is the translation in axes x right, y down, z forward
};

/// A camera as in the file, with its pose still to be understood.
struct QualisysCamera {
  Camera camera;
  Eigen::Matrix3d M;
  Eigen::Vector3d p;
  bool in_pixels = false;  ///< intrinsics in pixels, as Theia writes them
  bool films = false;      ///< no camera for markers only
};

Camera qualisys_camera(const QualisysCamera& in, QualisysPose pose) {
  const Eigen::Matrix3d flip = Eigen::Vector3d(1, -1, -1).asDiagonal();
  Camera camera = in.camera;
  switch (pose) {
    case QualisysPose::centre:
      set_pose_at(camera, flip * in.M, in.p);
      break;
    case QualisysPose::theia:
      camera.R = in.M;
      camera.t = in.p;
      break;
    case QualisysPose::translation:
      camera.R = flip * in.M;
      camera.t = flip * in.p;
      break;
    case QualisysPose::translation_down:
      camera.R = flip * in.M;
      camera.t = in.p;
      break;
  }
  return camera;
}

std::vector<Camera> qualisys_cameras(const std::vector<QualisysCamera>& in, QualisysPose pose) {
  std::vector<Camera> cameras;
  cameras.reserve(in.size());
  for (const QualisysCamera& camera : in) cameras.push_back(qualisys_camera(camera, pose));
  return cameras;
}

/// Whether a model of camera takes videos. Files of other programs name no model.
bool qualisys_films(const std::string& name) {
  const std::string model = lower_case(name);
  if (model.empty() || model == "none") return true;
  if (model.find("video") != std::string::npos || model.find("hybrid") != std::string::npos) return true;
  // "Oqus 210c": a colour camera.
  return model.size() > 1 && model.back() == 'c' && std::isdigit(static_cast<unsigned char>(model[model.size() - 2]));
}

bool qualisys_upside_down(const std::vector<Camera>& cameras) {
  double up = 0.0;
  for (const Camera& camera : cameras) up -= camera.R(1, 2) / static_cast<double>(cameras.size());
  return up < kQualisysUpsideDown;
}

class QualisysReader {
 public:
  explicit QualisysReader(const std::filesystem::path& path) : file_(path) {}

  Calibration read() {
    calibration_.unit = "mm";
    calibration_.up = "+z";
    for (const pugi::xml_node& node : cameras_node().children("camera")) read_camera(node);
    if (found_.empty())
      fail_at({file_.path().string(), 0}, "reading a camera calibration: the file has no calibrated <camera>");
    choose_video_cameras();
    choose_poses();
    note_left_out();
    return std::move(calibration_);
  }

 private:
  /// <calibration><cameras>, which may stand in the settings of the real-time protocol.
  pugi::xml_node cameras_node() const {
    const pugi::xml_node root = file_.root();
    const bool at_root = std::string_view(root.name()) == "calibration";
    const pugi::xml_node cameras = (at_root ? root : root.child("calibration")).child("cameras");
    if (!cameras)
      fail_at(file_.where(root), "reading a camera calibration: expected <calibration><cameras> in <{}>", root.name());
    return cameras;
  }

  void read_camera(const pugi::xml_node& node) {
    const std::string serial = XmlPart(file_, node, "a camera").text("serial");
    const XmlPart part(file_, node, "camera " + serial);
    const bool uncalibrated = part.text_or("active", "1") == "0" || part.text_or("calibrated", "true") == "false" ||
                              !part.has_child("transform");
    if (uncalibrated) {
      ++uncalibrated_;
      return;
    }
    QualisysCamera camera;
    camera.camera.name = serial;
    camera.films = qualisys_films(part.text_or("model", ""));
    read_transform(part.child("transform"), camera);
    read_intrinsics(part, camera);
    turned_ += part.number_or("viewrotation", 0.0) != 0.0 ? 1 : 0;
    found_.push_back(camera);
  }

  void read_transform(const XmlPart& part, QualisysCamera& camera) const {
    static constexpr const char* kKeys[9] = {"r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"};
    std::array<double, 9> rows{};
    for (std::size_t i = 0; i < 9; ++i) rows[i] = part.number(kKeys[i]);
    camera.M = repaired_rotation(matrix_from_rows(rows));
    camera.p = kQualisysMetresPerUnit * Eigen::Vector3d(part.number("x"), part.number("y"), part.number("z"));
  }

  void read_intrinsics(const XmlPart& part, QualisysCamera& camera) const {
    const XmlPart in = part.child("intrinsic");
    if (in.number_or("skew", 0.0) != 0.0)
      in.fail_here("skew is {}, only cameras without skew can be read", in.number("skew"));
    camera.in_pixels = in.number("sensorMaxU") <= kQualisysLargestSensor;
    const double scale = camera.in_pixels ? 1.0 : 1.0 / kQualisysPartsOfPixel;
    const Eigen::Vector2d corner = read_size(part, in, scale, camera.camera);
    camera.camera.K = intrinsics(scale * in.number("focalLengthU"), scale * in.number("focalLengthV"),
                                 scale * in.number("centerPointU") - corner.x(),
                                 scale * in.number("centerPointV") - corner.y(), PixelCentre::integer);
    const double lens[5] = {in.number("radialDistortion1"), in.number("radialDistortion2"), tangential(in, '1'),
                            tangential(in, '2'), in.number_or("radialDistortion3", 0.0)};
    set_distortion(camera.camera, Lens::opencv, lens, in.where());
  }

  /// The key is misspelt in the files of Qualisys.
  double tangential(const XmlPart& in, char index) const {
    const std::string misspelt = std::string("tangentalDistortion") + index;
    const std::string spelt = std::string("tangentialDistortion") + index;
    return in.number(in.has(spelt.c_str()) ? spelt.c_str() : misspelt.c_str());
  }

  /// The part of the sensor that the video shows. @return its corner on the sensor, pixels
  Eigen::Vector2d read_size(const XmlPart& part, const XmlPart& in, double scale, Camera& camera) const {
    Eigen::Vector2d corner = Eigen::Vector2d::Zero(), size;
    if (part.has_child("fov_video")) {
      const XmlPart fov = part.child("fov_video");
      corner = {fov.number("left"), fov.number("top")};
      size = Eigen::Vector2d(fov.number("right"), fov.number("bottom")) - corner + Eigen::Vector2d::Ones();
    } else {
      size = scale * Eigen::Vector2d(in.number("sensorMaxU") - in.number_or("sensorMinU", 0.0),
                                     in.number("sensorMaxV") - in.number_or("sensorMinV", 0.0));
      size = size.array().round();  // the last part of a pixel is missing
    }
    camera.width = image_side(size.x());
    camera.height = image_side(size.y());
    if (camera.width == 0 || camera.height == 0) part.fail_here("the image has {} x {} pixels", size.x(), size.y());
    return corner;
  }

  void choose_video_cameras() {
    const auto films = [](const QualisysCamera& camera) { return camera.films; };
    if (std::none_of(found_.begin(), found_.end(), films)) {
      calibration_.notes.emplace_back("the file has no video camera; all its cameras were taken");
      return;
    }
    marker_only_ = found_.size();
    std::erase_if(found_, [&](const QualisysCamera& camera) { return !films(camera); });
    marker_only_ -= found_.size();
  }

  /// Takes the first reading with which all cameras look at one point and are not upside down. (With a translation,
  /// cameras with y and z reversed stand opposite to their position, look at the same point, and are upside down.)
  void choose_poses() {
    using enum QualisysPose;
    const std::array<QualisysPose, 4> readings = found_.front().in_pixels
                                                     ? std::array{theia, centre, translation_down, translation}
                                                     : std::array{centre, translation_down, theia, translation};
    for (const QualisysPose reading : readings) {
      calibration_.cameras = qualisys_cameras(found_, reading);
      if (!look_at_one_point(calibration_.cameras) || qualisys_upside_down(calibration_.cameras)) continue;
      if (reading != QualisysPose::centre)
        calibration_.notes.emplace_back(
            "x y z was taken as the translation, as Theia writes it, not as the centre of the camera: only so all "
            "cameras look at one point");
      return;
    }
    calibration_.cameras = qualisys_cameras(found_, readings.front());
    calibration_.notes.emplace_back(fmt::format(
        "x y z was taken as the {} as {} writes it; whether the cameras look at one point could not confirm "
        "this",
        readings.front() == QualisysPose::centre ? "centre of the camera," : "translation,",
        readings.front() == QualisysPose::centre ? "Qualisys" : "Theia"));
  }

  void note_left_out() {
    if (marker_only_ > 0)
      calibration_.notes.emplace_back(fmt::format("{} cameras for markers only were left out", marker_only_));
    if (uncalibrated_ > 0)
      calibration_.notes.emplace_back(
          fmt::format("{} cameras that are inactive or not calibrated were left out", uncalibrated_));
    if (turned_ > 0)
      calibration_.notes.emplace_back(fmt::format(
          "{} cameras are turned for display (viewrotation); the calibration holds for their images before the turn",
          turned_));
  }

  XmlFile file_;
  std::vector<QualisysCamera> found_;
  std::size_t marker_only_ = 0;
  int uncalibrated_ = 0, turned_ = 0;
  Calibration calibration_;
};

/// Calibrations of Qualisys Track Manager (`.qca.txt`, XML) and the look-alike that Theia writes. Semantics: as
/// Pose2Sim reads these files, and Theia's documentation.
///
/// X_cam = R (X - C), with C = x y z in millimetres and R = diag(1, -1, -1) M, where row i of M is ri1 ri2 ri3; z is
/// up. Focal lengths and centres of projection are in 1/64 pixel of the sensor, of which the video shows `fov_video`.
/// The coefficients k1 k2 k3 and p1 p2 are plain: they are not divided by 64. Theia writes pixels, X_cam = M X + (x y
/// z), and an M of axes x right, y down, z forward; whether all cameras look at one point tells the two apart.
class QualisysCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "qualisys"; }

  bool recognises(const CalibrationSource& source) const override {
    const std::string head = readable_head(source);
    const std::string_view root = root_element(head);
    if (root != "calibration" && root.substr(0, 14) != "QTM_Parameters") return false;
    return head.find("<cameras") != std::string::npos &&
           (head.find("sensorMaxU") != std::string::npos || head.find("<fov_video") != std::string::npos);
  }

  Calibration read(const CalibrationSource& source) const override { return QualisysReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_qualisys_calibration() { return std::make_unique<QualisysCalibration>(); }

}  // namespace doppel
