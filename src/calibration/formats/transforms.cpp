#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/image_file.h"

namespace doppel {
namespace {

using TransformsJson = nlohmann::json;

constexpr double kTransformsRigid = 1e-4;  // how far an applied_transform may be off a rotation with a scale
/// Our own writer states the axes, so that they need not be found out. Other readers ignore this key.
constexpr const char* kTransformsAxesKey = "camera_axes";
constexpr const char* kTransformsAxes = "x right, y up, z backward";
constexpr const char* kTransformsImageEndings[] = {".png", ".jpg", ".jpeg", ".PNG", ".JPG",  ".JPEG",
                                                   ".exr", ".tif", ".tiff", ".bmp", ".webp", ".hdr"};

/// A camera in the world of the file: its axes (x right, y up, z backward) as columns, and its centre.
struct TransformsPose {
  Eigen::Matrix3d axes;
  Eigen::Vector3d centre;
};

/// The parts of `file_path` that can name a camera.
struct TransformsPath {
  std::string stem, folder, flat;  ///< flat: the whole path with _ for /
};

TransformsPath split_transforms_path(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  while (path.rfind("./", 0) == 0) path.erase(0, 2);
  // Names without an ending may hold a dot ("S1.54138969").
  for (const char* ending : kTransformsImageEndings) {
    const std::string_view end(ending);
    if (path.size() <= end.size() || std::string_view(path).substr(path.size() - end.size()) != end) continue;
    path.erase(path.size() - end.size());
    break;
  }
  TransformsPath parts;
  const std::size_t slash = path.rfind('/');
  parts.stem = slash == std::string::npos ? path : path.substr(slash + 1);
  if (slash != std::string::npos) {
    const std::string folders = path.substr(0, slash);
    const std::size_t before = folders.rfind('/');
    parts.folder = before == std::string::npos ? folders : folders.substr(before + 1);
  }
  parts.flat = path;
  std::replace(parts.flat.begin(), parts.flat.end(), '/', '_');
  return parts;
}

/// One name per camera, all different: the names of the image files, or of their folders, or the paths.
std::vector<std::string> transforms_names(const std::vector<TransformsPath>& paths, bool prefer_folders) {
  std::vector<std::string TransformsPath::*> choices = {&TransformsPath::stem, &TransformsPath::folder,
                                                        &TransformsPath::flat};
  if (prefer_folders) std::swap(choices[0], choices[1]);
  for (const auto part : choices) {
    std::vector<std::string> names;
    names.reserve(paths.size());
    for (const TransformsPath& path : paths) names.push_back(path.*part);
    const std::set<std::string> different(names.begin(), names.end());
    if (different.size() == names.size() && !different.contains("")) return names;
  }
  std::vector<std::string> names;
  names.reserve(paths.size());
  for (const TransformsPath& path : paths) names.push_back(fmt::format("{}_{}", path.flat, names.size()));
  return names;
}

/// Reads one file; every message names the frame and the key.
class TransformsReader {
 public:
  explicit TransformsReader(const std::filesystem::path& path) : path_(path), where_{path.string(), 0} {}

  Calibration read() {
    root_ = read_json(path_);
    const TransformsJson frames = root_.is_object() ? root_.value("frames", TransformsJson()) : TransformsJson();
    if (!frames.is_array() || frames.empty())
      fail_at(where_, "reading a camera calibration: \"frames\" must be a list of cameras");
    is_ours_ = root_.contains(kTransformsAxesKey) && root_[kTransformsAxesKey] == kTransformsAxes;
    if (root_.contains("applied_transform")) read_applied_transform();
    std::size_t without_pose = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) without_pose += !read_frame(frames[i], i);
    if (poses_.empty())
      fail_at(where_, "reading a camera calibration: no item of \"frames\" has a \"transform_matrix\"");
    Calibration calibration = placed();
    calibration.cameras = distinct(calibration.cameras, calibration.notes);
    if (without_pose > 0)
      calibration.notes.emplace_back(fmt::format("{} frames without a transform_matrix were left out", without_pose));
    return calibration;
  }

 private:
  /// Reads a frame into cameras_, paths_ and poses_. @return false when it has no pose
  bool read_frame(const TransformsJson& frame, std::size_t index) {
    what_ = fmt::format("frame {}: ", index);
    if (!frame.is_object()) fail_at(where_, "reading a camera calibration: {}must be an object", what_);
    if (!frame.contains("transform_matrix")) return false;
    const TransformsJson path = frame.value("file_path", TransformsJson());
    if (!path.is_string()) fail_at(where_, "reading a camera calibration: {}file_path must be a text", what_);
    what_ = fmt::format("frame {} ({}): ", index, path.get<std::string>());
    poses_.push_back(read_pose(frame["transform_matrix"]));
    paths_.push_back(split_transforms_path(path.get<std::string>()));
    Camera camera;
    camera.name = path.get<std::string>();
    read_size(frame, path.get<std::string>(), camera);
    read_intrinsics(frame, camera);
    read_lens(frame, camera);
    cameras_.push_back(std::move(camera));
    return true;
  }

  TransformsPose read_pose(const TransformsJson& matrix) const {
    const std::vector<double> m = rows(matrix, what_ + "transform_matrix");
    TransformsPose pose;
    pose.axes << m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10];
    pose.centre << m[3], m[7], m[11];
    return pose;
  }

  /// The 12 numbers of a 3 x 4 matrix, or of a 4 x 4 matrix whose last row is 0 0 0 1.
  std::vector<double> rows(const TransformsJson& matrix, const std::string& what) const {
    std::vector<double> m = numbers(matrix, 0, what, where_);
    if (m.size() != 12 && m.size() != 16)
      fail_at(where_, "reading a camera calibration: {} has {} numbers, expected 12 or 16", what, m.size());
    if (m.size() == 16 && (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1))
      fail_at(where_, "reading a camera calibration: the last row of {} is {} {} {} {}, it must be 0 0 0 1", what,
              m[12], m[13], m[14], m[15]);
    m.resize(12);
    return m;
  }

  /// nerfstudio: world of the file = applied_scale * applied_transform * original world.
  void read_applied_transform() {
    const std::vector<double> m = rows(root_["applied_transform"], "applied_transform");
    Eigen::Matrix3d linear;
    linear << m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10];
    stretch_ = std::cbrt(linear.determinant());
    turn_ = linear / stretch_;
    offset_ = Eigen::Vector3d(m[3], m[7], m[11]);
    if (!(stretch_ > 0) || !(turn_ * turn_.transpose()).isIdentity(kTransformsRigid))
      fail_at(where_, "reading a camera calibration: applied_transform must be a rotation with a positive scale");
    if (root_.contains("applied_scale")) scale_ = number(root_, "applied_scale", "applied_scale", where_);
    if (!(scale_ > 0))
      fail_at(where_, "reading a camera calibration: applied_scale is {}, it must be positive", scale_);
  }

  /// A value of the frame, or of the file for all frames. Null when both lack it.
  const TransformsJson* find(const TransformsJson& frame, const char* key) const {
    return frame.contains(key) ? &frame[key] : root_.contains(key) ? &root_[key] : nullptr;
  }

  std::optional<double> value(const TransformsJson& frame, const char* key) const {
    if (!find(frame, key)) return std::nullopt;
    return number(frame.contains(key) ? frame : root_, key, what_ + key, where_);
  }

  void read_size(const TransformsJson& frame, const std::string& file, Camera& camera) {
    const std::optional<double> w = value(frame, "w"), h = value(frame, "h");
    if (w && h) {
      camera.width = image_side(*w, what_ + "w", where_);
      camera.height = image_side(*h, what_ + "h", where_);
      return;
    }
    for (const char* ending : {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
      std::error_code ignored;
      const std::filesystem::path image = resolve_path(path_, file + ending);
      if (!std::filesystem::is_regular_file(image, ignored)) continue;
      const cv::Size pixels = size_of_image(image);
      camera.width = pixels.width;
      camera.height = pixels.height;
      return;
    }
  }

  /// Size of an image as it is read from footage.
  cv::Size size_of_image(const std::filesystem::path& image) const {
    try {
      return read_image(image).size();
    } catch (const FileError&) {
      fail_at(where_, "reading a camera calibration: {}w and h are missing, and {} is no image; add \"w\" and \"h\"",
              what_, image.string());
    }
  }

  void read_intrinsics(const TransformsJson& frame, Camera& camera) const {
    const TransformsJson* const matrix = find(frame, "K");
    if (matrix && !find(frame, "fl_x")) {
      camera.K = intrinsics(numbers(*matrix, 9, what_ + "K", where_), PixelCentre::half, where_);
      return;
    }
    const std::optional<double> fx = focal_length(frame, "fl_x", "camera_angle_x", camera.width, camera);
    const std::optional<double> fy = focal_length(frame, "fl_y", "camera_angle_y", camera.height, camera);
    if (!fx && !fy)
      fail_at(where_, "reading a camera calibration: {}fl_x is missing, and so are camera_angle_x and K", what_);
    const std::optional<double> cx = value(frame, "cx"), cy = value(frame, "cy");
    if (!cx || !cy) require_size(camera, "cx or cy is missing");
    // With one focal length, pixels are square.
    camera.K = intrinsics(fx ? *fx : *fy, fy ? *fy : *fx, cx.value_or(0.5 * camera.width),
                          cy.value_or(0.5 * camera.height), PixelCentre::half);
  }

  std::optional<double> focal_length(const TransformsJson& frame, const char* key, const char* angle_key, int size,
                                     const Camera& camera) const {
    if (find(frame, key)) return value(frame, key);
    const std::optional<double> angle = value(frame, angle_key);
    if (!angle) return std::nullopt;
    if (!(*angle > 0 && *angle < std::numbers::pi))
      fail_at(where_, "reading a camera calibration: {}{} is {}, allowed are 0 to pi", what_, angle_key, *angle);
    require_size(camera, fmt::format("{} is missing", key));
    return 0.5 * size / std::tan(0.5 * *angle);
  }

  void require_size(const Camera& camera, const std::string& reason) const {
    if (camera.width > 0 && camera.height > 0) return;
    fail_at(where_,
            "reading a camera calibration: {}{}, so that the size of the images is needed, but the file has no \"w\" "
            "and \"h\", and the image is not beside the file; add \"w\" and \"h\", or put the images there",
            what_, reason);
  }

  void read_lens(const TransformsJson& frame, Camera& camera) const {
    const auto k = [&](const char* key) { return value(frame, key).value_or(0.0); };
    if (is_fisheye(frame)) {
      if (k("p1") != 0 || k("p2") != 0)
        fail_at(where_, "reading a camera calibration: {}a fisheye lens must not have p1 and p2", what_);
      set_distortion(camera, Lens::fisheye, std::vector<double>{k("k1"), k("k2"), k("k3"), k("k4")}, where_);
      return;
    }
    // nerfstudio's k4 is the coefficient of r^8, not that of OpenCV's denominator.
    const std::array<double, 6> coefficients{k("k1"), k("k2"), k("p1"), k("p2"), k("k3"), k("k4")};
    set_distortion(camera, Lens::polynomial, coefficients, where_);
  }

  bool is_fisheye(const TransformsJson& frame) const {
    for (const char* key : {"ftheta_p0", "equirectangular", "latlong"}) {
      const TransformsJson* const other = find(frame, key);
      if (other && *other != false)
        fail_at(where_, "reading a camera calibration: {}the lens model of \"{}\" is not supported", what_, key);
    }
    const TransformsJson* const flag = find(frame, "is_fisheye");
    const bool flagged = flag && (flag->is_boolean() ? flag->get<bool>() : *flag == 1);
    const TransformsJson* const model = find(frame, "camera_model");
    if (!model) return flagged;
    if (*model == "OPENCV_FISHEYE") return true;
    for (const char* known : {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"})
      if (*model == known) return flagged;
    fail_at(where_,
            "reading a camera calibration: {}camera_model is {}, allowed are OPENCV, OPENCV_FISHEYE, PINHOLE, "
            "SIMPLE_PINHOLE, SIMPLE_RADIAL and RADIAL",
            what_, model->dump());
  }

  /// The cameras with their poses, and what is known about their world.
  Calibration placed() {
    Calibration calibration;
    calibration.has_scale = false;
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      const Eigen::Matrix3d R = Eigen::Vector3d(1, -1, -1).asDiagonal() * poses_[i].axes.transpose() * turn_;
      const Eigen::Vector3d centre = turn_.transpose() * (poses_[i].centre / scale_ - offset_) / stretch_;
      set_pose_at(cameras_[i], mended(R), centre);
    }
    const bool forward = !is_ours_ && has_forward_axes();
    if (forward) {
      for (Camera& camera : cameras_) {
        camera.R.bottomRows<2>() *= -1.0;
        camera.t.tail<2>() *= -1.0;
      }
      calibration.notes.emplace_back(
          "the matrices were taken with z forward and y down: with z backward, as the format has it, the cameras would "
          "look away from each other");
    }
    if (root_.contains("applied_transform"))
      calibration.notes.emplace_back("applied_transform was undone, so that the world is that of the reconstruction");
    else if (!forward)
      calibration.up = "+z";
    calibration.cameras = std::move(cameras_);
    return calibration;
  }

  /// Keeps rotations of single precision as they are, so that a camera that is written and read again is the same.
  static Eigen::Matrix3d mended(const Eigen::Matrix3d& R) {
    constexpr double kSinglePrecision = 1e-5;
    const Eigen::Matrix3d nearest = repaired_rotation(R);
    return (nearest - R).cwiseAbs().maxCoeff() < kSinglePrecision ? R : nearest;
  }

  /// Whether the third column of the matrices points forward, against the rule of the format: then the cameras look
  /// away from the position that their axes have in common, and they are upside down in a world with z up.
  bool has_forward_axes() const {
    constexpr double kUpright = 0.3, kSpread = 0.5;
    const std::optional<CommonView> view = common_view(cameras_);
    if (!view || !(view->median_distance < -kSpread * view->median_depth)) return false;
    double up = 0;
    for (const TransformsPose& pose : poses_) up += pose.axes(2, 1) / static_cast<double>(poses_.size());
    return 10 * as_size(view->behind) >= 9 * cameras_.size() && up < kUpright;
  }

  /// Leaves out frames that repeat the camera of their folder (a video), and names the others.
  std::vector<Camera> distinct(const std::vector<Camera>& cameras, std::vector<std::string>& notes) const {
    std::map<std::string, const Camera*> first_in_folder;
    std::vector<Camera> kept;
    std::vector<TransformsPath> paths;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const std::string folder = paths_[i].flat.substr(0, paths_[i].flat.size() - paths_[i].stem.size());
      const Camera* first = first_in_folder.try_emplace(folder, &cameras[i]).first->second;
      if (!is_ours_ && first != &cameras[i] && is_same(*first, cameras[i])) continue;
      kept.push_back(cameras[i]);
      paths.push_back(paths_[i]);
    }
    const std::size_t repeated = cameras.size() - kept.size();
    if (repeated > 0)
      notes.emplace_back(fmt::format("{} frames that repeat the camera of their folder were left out", repeated));
    const std::vector<std::string> names = transforms_names(paths, repeated > 0);
    for (std::size_t i = 0; i < kept.size(); ++i) kept[i].name = names[i];
    return kept;
  }

  static bool is_same(const Camera& a, const Camera& b) {
    return a.width == b.width && a.height == b.height && a.K == b.K && a.R == b.R && a.t == b.t && a.lens == b.lens &&
           a.distortion == b.distortion;
  }

  std::filesystem::path path_;
  FileLocation where_;
  TransformsJson root_;
  std::string what_;      // the frame that is being read, for messages
  bool is_ours_ = false;  // written by TransformsCalibration::write
  std::vector<Camera> cameras_;
  std::vector<TransformsPath> paths_;
  std::vector<TransformsPose> poses_;
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();  // applied_transform = stretch_ turn_ x + offset_
  Eigen::Vector3d offset_ = Eigen::Vector3d::Zero();
  double stretch_ = 1, scale_ = 1;
};

/// Throws for what the format cannot hold.
void check_transforms_camera(const Camera& camera) {
  const std::vector<std::string> faults = camera.faults();
  if (!faults.empty()) fail("writing a camera calibration: {}", faults.front());
  if (camera.K(0, 1) != 0)
    fail("writing a camera calibration: camera {} has skew {}, which transforms.json cannot hold", camera.name,
         camera.K(0, 1));
  if (camera.lens == Lens::polynomial ||
      std::any_of(camera.distortion.begin() + 5, camera.distortion.end(), [](double c) { return c != 0; }))
    fail(
        "writing a camera calibration: the lens of camera {} has more than k1 k2 p1 p2 k3 of OpenCV or the four "
        "coefficients of a fisheye, which transforms.json cannot hold",
        camera.name);
}

nlohmann::ordered_json transforms_frame(const Camera& camera) {
  const bool fisheye = camera.lens == Lens::fisheye;
  const auto& d = camera.distortion;
  // The inverse, not the transpose: reading gives back R and t of a matrix that is a rotation to few digits only.
  const Eigen::Vector3d centre = -camera.R.inverse() * camera.t;
  const Eigen::Matrix3d axes = camera.R.transpose() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  // Our y is the file's z: (x, y, z) becomes (x, -z, y).
  nlohmann::ordered_json matrix = nlohmann::ordered_json::array();
  matrix.push_back({axes(0, 0), axes(0, 1), axes(0, 2), centre.x()});
  matrix.push_back({-axes(2, 0), -axes(2, 1), -axes(2, 2), -centre.z()});
  matrix.push_back({axes(1, 0), axes(1, 1), axes(1, 2), centre.y()});
  matrix.push_back({0.0, 0.0, 0.0, 1.0});
  std::string file = camera.name;
  std::replace(file.begin(), file.end(), '/', '_');
  std::replace(file.begin(), file.end(), '\\', '_');
  nlohmann::ordered_json frame;
  frame["file_path"] = "images/" + file + ".png";
  frame["w"] = camera.width;
  frame["h"] = camera.height;
  frame["fl_x"] = camera.K(0, 0);
  frame["fl_y"] = camera.K(1, 1);
  frame["cx"] = camera.K(0, 2);
  frame["cy"] = camera.K(1, 2);
  frame["k1"] = d[0];
  frame["k2"] = d[1];
  frame["k3"] = fisheye ? d[2] : d[4];
  frame["k4"] = fisheye ? d[3] : 0.0;
  frame["p1"] = fisheye ? 0.0 : d[2];
  frame["p2"] = fisheye ? 0.0 : d[3];
  frame["camera_model"] = fisheye ? "OPENCV_FISHEYE" : "OPENCV";
  frame["is_fisheye"] = fisheye;
  frame["transform_matrix"] = std::move(matrix);
  return frame;
}

/// `transforms.json` of NeRF-synthetic, instant-ngp and nerfstudio: intrinsics for the whole file or for each item of
/// `frames`, whose values are taken first, and `transform_matrix`, world from camera with x right, y up and z backward.
/// The world has z up, except that nerfstudio's `applied_transform` is undone, which leaves the axes of the
/// reconstruction. The unit is arbitrary.
/// - Without `fl_x`: fx = w / (2 tan(camera_angle_x / 2)), with the size of the image file if `w` is missing.
/// - k1 k2 p1 p2 k3 are OpenCV's; k4 belongs to r^8 (nerfstudio). `is_fisheye` or OPENCV_FISHEYE: k1 to k4 of theta.
/// - The centre of the first pixel is (0.5, 0.5): instant-ngp and nerfstudio take over COLMAP's numbers.
/// - Some programs write matrices with z forward and y down; they are recognised by cameras that look outward.
/// - A frame is a camera. Frames of a folder that have the same pose are those of a video, and give one camera.
class TransformsCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "nerfstudio"; }
  bool recognises(const CalibrationSource& source) const override {
    return source.has("\"frames\"") && source.has("\"transform_matrix\"");
  }
  Calibration read(const CalibrationSource& source) const override { return TransformsReader(source.path).read(); }

  bool can_write() const override { return true; }
  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    nlohmann::ordered_json file, frames = nlohmann::ordered_json::array();
    for (const Camera& camera : cameras) {
      check_transforms_camera(camera);
      frames.push_back(transforms_frame(camera));
    }
    // nerfstudio looks for the lens model only here.
    const bool same_lens = std::all_of(cameras.begin(), cameras.end(),
                                       [&](const Camera& camera) { return camera.lens == cameras.front().lens; });
    if (same_lens && !cameras.empty()) file["camera_model"] = frames.front()["camera_model"];
    file[kTransformsAxesKey] = kTransformsAxes;
    file["frames"] = std::move(frames);
    write_atomically(path, file.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_transforms_calibration() { return std::make_unique<TransformsCalibration>(); }

}  // namespace doppel
