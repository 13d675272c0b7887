#include <algorithm>
#include <array>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/inverse_lens.h"
#include "doppel/calibration/formats/xml_parts.h"

namespace doppel {
namespace {

constexpr double kOptitrackLargestResidual = 0.1;  // pixels
constexpr int kOptitrackMaxDepth = 16;

/// The vendor's lens, from the image with distortion to the one without.
struct OptitrackLens {
  double k1 = 0, k2 = 0, k3 = 0, tx = 0, ty = 0;

  bool is_zero() const { return k1 == 0 && k2 == 0 && k3 == 0 && tx == 0 && ty == 0; }
  /// As the vendor prints it: the squares of the tangential part have the factor 1, not 2.
  Eigen::Vector2d undistorted(const Eigen::Vector2d& p) const {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {x * radial + 2 * tx * x * y + ty * (r2 + x * x), y * radial + 2 * ty * x * y + tx * (r2 + y * y)};
  }
};

/// The first element <Cameras> below a node that lists cameras.
pugi::xml_node optitrack_cameras(const pugi::xml_node& node, int depth = 0) {
  if (std::string_view(node.name()) == "Cameras" && node.child("Camera")) return node;
  if (depth == kOptitrackMaxDepth) return {};
  for (const pugi::xml_node& child : node.children())
    if (const pugi::xml_node found = optitrack_cameras(child, depth + 1)) return found;
  return {};
}

class OptitrackReader {
 public:
  explicit OptitrackReader(const std::filesystem::path& path) : file_(path) {}

  Calibration read() {
    calibration_.unit = "m";
    calibration_.up = "+y";
    for (const pugi::xml_node& node : optitrack_cameras(file_.root()).children("Camera")) read_camera(node);
    if (calibration_.cameras.empty())
      fail_at({file_.path().string(), 0}, "reading a camera calibration: the file has no calibrated <Camera>");
    note_lenses();
    return std::move(calibration_);
  }

 private:
  void read_camera(const pugi::xml_node& node) {
    const std::string serial = XmlPart(file_, node, "a camera").text("Serial");
    const XmlPart part(file_, node, "camera " + serial);
    if (!part.has_child("Extrinsic")) {
      ++without_pose_;
      return;
    }
    Camera camera;
    camera.name = serial;
    const XmlPart attributes = part.child("Attributes");
    camera.width = attributes.pixels("ImagerPixelWidth");
    camera.height = attributes.pixels("ImagerPixelHeight");
    read_lens(part.child("IntrinsicStandardCameraModel"), camera);
    read_pose(part.child("Extrinsic"), camera);
    calibration_.cameras.push_back(camera);
  }

  void read_lens(const XmlPart& part, Camera& camera) {
    camera.K = intrinsics(part.number("HorizontalFocalLength"), part.number("VerticalFocalLength"),
                          part.number("LensCenterX"), part.number("LensCenterY"), PixelCentre::half);
    const OptitrackLens lens{part.number("k1"), part.number("k2"), part.number("k3"), part.number("TangentialX"),
                             part.number("TangentialY")};
    if (lens.is_zero()) return;
    const auto fitted = fit_inverse_lens([&](const Eigen::Vector2d& p) { return lens.undistorted(p); }, camera);
    if (!fitted)
      part.fail_here("the lens (k1 {}, k2 {}, k3 {}) has no inverse in the image", lens.k1, lens.k2, lens.k3);
    if (!(fitted->largest_residual_px <= kOptitrackLargestResidual))
      part.fail_here(
          "the inverse of the lens can be fitted to {:.3g} pixels only, allowed are {}; take the distortion out of the "
          "images and write 0 for k1 k2 k3 TangentialX TangentialY",
          fitted->largest_residual_px, kOptitrackLargestResidual);
    set_distortion(camera, Lens::opencv, fitted->coefficients, part.where());
    ++fitted_;
    largest_residual_px_ = std::max(largest_residual_px_, fitted->largest_residual_px);
  }

  static void read_pose(const XmlPart& part, Camera& camera) {
    std::array<double, 9> rows{};
    for (std::size_t i = 0; i < 9; ++i) rows[i] = part.number(("OrientMatrix" + std::to_string(i)).c_str());
    const Eigen::Matrix3d world_from_camera = repaired_rotation(matrix_from_rows(rows));
    const Eigen::Matrix3d flip = Eigen::Vector3d(1, -1, -1).asDiagonal();
    set_pose_at(camera, flip * world_from_camera.transpose(), {part.number("X"), part.number("Y"), part.number("Z")});
  }

  void note_lenses() {
    if (fitted_ > 0)
      calibration_.notes.emplace_back(
          fmt::format("the file describes the lenses from the image with distortion to the one without; their inverse "
                      "was fitted for {} cameras, with a residual of at most {:.2g} pixels",
                      fitted_, largest_residual_px_));
    if (without_pose_ > 0)
      calibration_.notes.emplace_back(fmt::format("{} cameras without <Extrinsic> were left out", without_pose_));
  }

  XmlFile file_;
  int fitted_ = 0, without_pose_ = 0;
  double largest_residual_px_ = 0;
  Calibration calibration_;
};

/// Calibrations of OptiTrack Motive 3.2 and later (`.mcal`, XML in UTF-8 or UTF-16; the older `.cal` is binary).
/// Semantics: the vendor's page on .mcal files.
///
/// X Y Z is the centre of the camera in metres. OrientMatrix0..8 is a rotation, row by row, from the camera to the
/// world with camera axes x right, y up, z backward, so that R = diag(1, -1, -1) M^T; y of the world is up.
/// <IntrinsicStandardCameraModel> is in pixels; <Intrinsic>, the vendor's own model, is never used. The centre of the
/// first pixel is not documented and taken as (0.5, 0.5). k1 k2 k3 TangentialX TangentialY lead from the image with
/// distortion to the one without: their inverse is fitted.
class OptitrackCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "optitrack"; }

  bool recognises(const CalibrationSource& source) const override {
    const std::string head = readable_head(source);
    if (root_element(head).empty()) return false;
    constexpr const char* kOwn[] = {"<MotiveBuildInfo", "<IntrinsicStandardCameraModel",
                                    "ImagerPixelWidth=", "OrientMatrix0="};
    return std::any_of(std::begin(kOwn), std::end(kOwn),
                       [&](const char* own) { return head.find(own) != std::string::npos; });
  }

  Calibration read(const CalibrationSource& source) const override { return OptitrackReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_optitrack_calibration() { return std::make_unique<OptitrackCalibration>(); }

}  // namespace doppel
