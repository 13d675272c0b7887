#include <algorithm>
#include <cmath>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/calibration/formats/xml_parts.h"

namespace doppel {
namespace {

constexpr double kViconMetresPerUnit = 0.001;

/// A camera as in the file, with the sense of its rotation still to be understood.
struct ViconCamera {
  Camera camera;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d position;
  bool films = false;      ///< a video camera
  double left_out_px = 0;  ///< how far the lens terms move a corner of the image
};

std::vector<Camera> vicon_cameras(const std::vector<ViconCamera>& in, bool transposed) {
  std::vector<Camera> cameras;
  for (const ViconCamera& camera : in) {
    cameras.push_back(camera.camera);
    set_pose_at(cameras.back(), transposed ? camera.rotation.transpose() : camera.rotation, camera.position);
  }
  return cameras;
}

/// Whether the camera is for videos, not for markers.
bool vicon_films(const XmlPart& part) {
  const std::string kind = part.text_or("TYPE", "") + " " + part.text_or("DISPLAY_TYPE", "");
  const bool video_kind = kind.find("Video") != std::string::npos || kind.find("VIDEO") != std::string::npos ||
                          kind.find("Vue") != std::string::npos;
  return part.text_or("SYSTEM", "") == "DV" || part.text_or("ISDV", "0") != "0" || video_kind;
}

/// How far the radial terms move the corner of the image that is farthest from their centre. The terms are k1 k2 k3 of
/// r^2, r^4 and r^6, with r in pixels.
double vicon_lens_shift(const XmlPart& frame, const Camera& camera) {
  std::vector<double> lens{camera.K(0, 2), camera.K(1, 2), 0.0, 0.0, 0.0};
  if (frame.has("VICON_RADIAL2")) {
    lens = frame.numbers_after_word("VICON_RADIAL2", 5);
  } else if (frame.has("VICON_RADIAL")) {
    const std::vector<double> k = frame.numbers("VICON_RADIAL", 2);
    std::copy(k.begin(), k.end(), lens.begin() + 2);
  }
  const double x = std::max(lens[0], camera.width - lens[0]), y = std::max(lens[1], camera.height - lens[1]);
  const double r2 = x * x + y * y;
  return std::abs(std::sqrt(r2) * r2 * (lens[2] + r2 * (lens[3] + r2 * lens[4])));
}

class ViconReader {
 public:
  explicit ViconReader(const std::filesystem::path& path) : file_(path) {}

  Calibration read() {
    calibration_.unit = "mm";
    calibration_.up = "+z";
    for (const pugi::xml_node& node : file_.root().children("Camera")) read_camera(node);
    if (found_.empty())
      fail_at({file_.path().string(), 0}, "reading a camera calibration: the file has no calibrated <Camera>");
    choose_video_cameras();
    choose_rotations();
    note_lens();
    if (uncalibrated_ > 0)
      calibration_.notes.emplace_back(fmt::format("{} cameras without a key frame were left out", uncalibrated_));
    return std::move(calibration_);
  }

 private:
  void read_camera(const pugi::xml_node& node) {
    const std::string id = XmlPart(file_, node, "a camera").text("DEVICEID");
    const XmlPart part(file_, node, "camera " + id);
    const auto keys = node.child("KeyFrames").children("KeyFrame");
    const auto count = std::distance(keys.begin(), keys.end());
    if (count == 0) {
      ++uncalibrated_;
      return;
    }
    if (count > 1) part.fail_here("it has {} key frames; only cameras that do not move can be read", count);
    const XmlPart frame = part.child("KeyFrames").child("KeyFrame");
    ViconCamera camera;
    camera.camera.name = id;
    camera.films = vicon_films(part);
    read_intrinsics(part, frame, camera.camera);
    camera.left_out_px = vicon_lens_shift(frame, camera.camera);
    const std::vector<double> q = frame.numbers("ORIENTATION", 4), position = frame.numbers("POSITION", 3);
    camera.rotation = rotation_from_quaternion(q[3], q[0], q[1], q[2], frame.where());
    camera.position = kViconMetresPerUnit * Eigen::Vector3d(position[0], position[1], position[2]);
    found_.push_back(camera);
  }

  void read_intrinsics(const XmlPart& part, const XmlPart& frame, Camera& camera) {
    const std::vector<double> size = part.numbers("SENSOR_SIZE", 2), centre = frame.numbers("PRINCIPAL_POINT", 2);
    camera.width = image_side(size[0]);
    camera.height = image_side(size[1]);
    if (camera.width == 0 || camera.height == 0)
      part.fail_here("SENSOR_SIZE is {} x {}, expected 1 to 65536 pixels per side", size[0], size[1]);
    if (part.number_or("SKEW", 0.0) != 0.0)
      part.fail_here("SKEW is {}, only cameras without skew can be read", part.number("SKEW"));
    const double focal = frame.number("FOCAL_LENGTH");
    const double aspect =
        frame.number_or("PIXEL_ASPECT_RATIO_CORRECTION", 1.0) / part.number_or("PIXEL_ASPECT_RATIO", 1.0);
    if (aspect != 1.0) ++not_square_;
    camera.K = intrinsics(focal, focal * aspect, centre[0], centre[1], PixelCentre::half);
  }

  void choose_video_cameras() {
    const auto films = [](const ViconCamera& camera) { return camera.films; };
    if (std::none_of(found_.begin(), found_.end(), films)) {
      calibration_.notes.emplace_back("the file has no video camera; all its cameras were taken");
      return;
    }
    const std::size_t markers_only = std::erase_if(found_, [&](const ViconCamera& camera) { return !films(camera); });
    if (markers_only > 0)
      calibration_.notes.emplace_back(fmt::format("{} cameras for markers only were left out", markers_only));
  }

  void choose_rotations() {
    calibration_.cameras = vicon_cameras(found_, false);
    if (look_at_one_point(calibration_.cameras)) return;
    const std::vector<Camera> transposed = vicon_cameras(found_, true);
    if (look_at_one_point(transposed)) {
      calibration_.cameras = transposed;
      calibration_.notes.emplace_back(
          "ORIENTATION was taken as the rotation from the camera to the world: only so all cameras look at one point");
      return;
    }
    calibration_.notes.emplace_back(
        "ORIENTATION was taken as the rotation from the world to the camera; whether the cameras look at one point "
        "could not confirm this");
  }

  void note_lens() {
    double largest = 0.0;
    for (const ViconCamera& camera : found_) largest = std::max(largest, camera.left_out_px);
    if (largest > 0.0)
      calibration_.notes.emplace_back(fmt::format(
          "the radial terms of the lenses were left out, because their direction is not documented; they "
          "move points by up to {:.1f} pixels at the corners of the images, so use images without distortion",
          largest));
    if (not_square_ > 0)
      calibration_.notes.emplace_back(
          fmt::format("{} cameras have pixels that are not square; the vertical focal length was taken as FOCAL_LENGTH "
                      "PIXEL_ASPECT_RATIO_CORRECTION / PIXEL_ASPECT_RATIO",
                      not_square_));
  }

  XmlFile file_;
  std::vector<ViconCamera> found_;
  int uncalibrated_ = 0, not_square_ = 0;
  Calibration calibration_;
};

/// Calibrations of Vicon Nexus (`.xcp`, XML). Semantics: as OpenCap, the readers of The Imaginarium and Pose2Sim read
/// these files, and Vicon's page on the quaternion.
///
/// X_cam = R (X - C), with C = POSITION in millimetres and R the matrix of ORIENTATION = x y z w (real part last); axes
/// x right, y down, z forward; z of the world is up. Pose2Sim takes the transpose of R: it is taken where only that
/// makes all cameras look at one point. FOCAL_LENGTH and PRINCIPAL_POINT are pixels; the centre of the first pixel is
/// not documented and taken as (0.5, 0.5). VICON_RADIAL and VICON_RADIAL2 are terms of radii in pixels, most likely
/// from the image with distortion to the one without; they are no coefficients of OpenCV and are left out.
class ViconCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "vicon"; }

  bool recognises(const CalibrationSource& source) const override {
    const std::string head = readable_head(source);
    return root_element(head) == "Cameras" && head.find("<Camera ") != std::string::npos &&
           (head.find("DEVICEID") != std::string::npos || head.find("<KeyFrame") != std::string::npos);
  }

  Calibration read(const CalibrationSource& source) const override { return ViconReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_vicon_calibration() { return std::make_unique<ViconCalibration>(); }

}  // namespace doppel
