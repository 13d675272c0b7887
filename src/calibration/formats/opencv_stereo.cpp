#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_map>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/file_storage.h"
#include "doppel/calibration/formats/format.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kOpenCvStereoMaxCameras = 1000;

/// The top-level nodes of a file that OpenCV's FileStorage wrote (YAML, XML or JSON).
class OpenCvStereoFile {
 public:
  explicit OpenCvStereoFile(const fs::path& path)
      : path_(path), where_{path.string(), 0}, root_(read_file_storage(path)) {
    for (const auto& [key, value] : root_.members) nodes_.emplace(key, &value);
  }

  ~OpenCvStereoFile() = default;
  OpenCvStereoFile(const OpenCvStereoFile&) = delete;  // the nodes point into the root
  OpenCvStereoFile& operator=(const OpenCvStereoFile&) = delete;

  const fs::path& path() const { return path_; }
  const FileLocation& where() const { return where_; }
  [[noreturn]] void refuse(const std::string& fault) const {
    fail_at(where_, "reading a camera calibration: {}", fault);
  }

  bool has(const std::string& key) const { return nodes_.contains(key); }
  /// The first key that the file has, or the first one of all.
  std::string key_of(std::initializer_list<std::string> keys) const {
    const auto found = std::find_if(keys.begin(), keys.end(), [&](const std::string& key) { return has(key); });
    return found != keys.end() ? *found : *keys.begin();
  }

  /// The numbers of a matrix or list. @param count how many there must be, or 0
  std::vector<double> numbers(const std::string& key, std::size_t count) const {
    std::vector<double> values = required(key).numbers(key, where_);
    if (count != 0 && values.size() != count)
      refuse(fmt::format("{} has {} numbers, expected {}", key, values.size(), count));
    return values;
  }

  double number(const std::string& key) const {
    const StorageValue& value = required(key);
    if (!value.is_number() || !std::isfinite(value.number)) refuse(key + " must hold finite numbers");
    return value.number;
  }
  std::string text(const std::string& key) const { return has(key) ? required(key).text : ""; }

 private:
  const StorageValue& required(const std::string& key) const {
    const auto node = nodes_.find(key);
    if (node == nodes_.end()) refuse(key + " is missing");
    return *node->second;
  }

  fs::path path_;
  FileLocation where_;
  StorageValue root_;
  std::unordered_map<std::string, const StorageValue*> nodes_;
};

/// Reads the cameras of one file, or of intrinsics and extrinsics that lie in two files.
class OpenCvStereoReader {
 public:
  explicit OpenCvStereoReader(const OpenCvStereoFile& file) : file_(file) {}

  Calibration read() {
    if (file_.has(matrix_key())) {
      read_single();
    } else if (file_.has("Ks")) {
      read_stacked();
    } else if (first_number() >= 0) {
      read_numbered();
    } else {
      file_.refuse("the file has no intrinsics; expected camera_matrix, K1 and K2 (or M1 and M2), or Ks");
    }
    return std::move(calibration_);
  }

  /// The pair R, T or the numbered R1, T1, ... Without T1 and T2, R1 and R2 are the rotations of the rectification.
  static bool has_poses(const OpenCvStereoFile& file) {
    return (file.has("R") && file.has("T")) || (file.has("R1") && file.has("T1")) || (file.has("R2") && file.has("T2"));
  }
  static bool has_numbered_intrinsics(const OpenCvStereoFile& file) {
    return OpenCvStereoReader(file).first_number() >= 0;
  }
  /// @param extrinsics the file with the poses; without one, they are sought in the file of the intrinsics
  void set_extrinsics(const OpenCvStereoFile* extrinsics) { extrinsics_ = extrinsics; }

 private:
  std::string matrix_key() const { return file_.key_of({"camera_matrix", "cameraMatrix", "Camera_Matrix"}); }

  int first_number() const {
    for (const int i : {0, 1}) {
      if (file_.has(fmt::format("K{}", i)) || file_.has(fmt::format("M{}", i))) return i;
    }
    return -1;
  }

  Lens lens() const {
    return file_.has("fisheye_model") && file_.number("fisheye_model") != 0 ? Lens::fisheye : Lens::opencv;
  }

  Camera intrinsics_of(const std::string& name, const std::string& matrix, const std::string& distortion) const {
    Camera camera;
    camera.name = name;
    camera.K = intrinsics(file_.numbers(matrix, 9), PixelCentre::integer, file_.where());
    set_distortion(camera, lens(), file_.numbers(distortion, 0), file_.where());
    if (file_.has("cameraResolution")) {
      set_size(camera, file_.numbers("cameraResolution", 2), "cameraResolution");
    } else if (const std::string width = file_.key_of({"image_width", "image_Width"}); file_.has(width)) {
      const std::string height = file_.key_of({"image_height", "image_Height"});
      set_size(camera, {file_.number(width), file_.number(height)}, width + " or " + height);
    }
    return camera;
  }

  void set_size(Camera& camera, const std::vector<double>& size, const std::string& key) const {
    camera.width = image_side(size[0], key, file_.where());
    camera.height = image_side(size[1], key, file_.where());
  }

  void read_single() {
    const std::string distortion = file_.key_of({"distortion_coefficients", "dist_coeffs", "Distortion_Coefficients"});
    calibration_.cameras.push_back(intrinsics_of(file_.path().stem().string(), matrix_key(), distortion));
    calibration_.has_poses = false;
  }

  void read_numbered() {
    const int first = first_number();
    for (int i = first;; ++i) {
      const std::string matrix = file_.key_of({fmt::format("K{}", i), fmt::format("M{}", i)});
      if (!file_.has(matrix)) break;
      if (calibration_.cameras.size() == kOpenCvStereoMaxCameras)
        file_.refuse(fmt::format("the file has more than {} cameras", kOpenCvStereoMaxCameras));
      calibration_.cameras.push_back(intrinsics_of(std::to_string(i), matrix, fmt::format("D{}", i)));
    }
    const OpenCvStereoFile& poses = extrinsics_ != nullptr ? *extrinsics_ : file_;
    if (!has_poses(poses)) {
      calibration_.has_poses = false;
      calibration_.notes.emplace_back("There are no extrinsics (R and T), so the cameras have no poses.");
    } else if (poses.has("R") && poses.has("T") && !(poses.has("R2") && poses.has("T2"))) {
      set_pair(poses);
    } else {
      set_numbered_poses(poses, first);
    }
  }

  void set_pair(const OpenCvStereoFile& poses) {
    if (calibration_.cameras.size() != 2) {
      file_.refuse(fmt::format("R and T of the extrinsics belong to two cameras, found the intrinsics of {}",
                               calibration_.cameras.size()));
    }
    set_pose(calibration_.cameras[1], poses, "R", "T");
  }

  void set_numbered_poses(const OpenCvStereoFile& poses, int first) {
    std::vector<Camera> with_pose;
    const std::size_t all = calibration_.cameras.size();
    for (std::size_t i = 0; i < all; ++i) {
      const std::string R = fmt::format("R{}", static_cast<int>(i) + first),
                        T = fmt::format("T{}", static_cast<int>(i) + first);
      // The first camera is the world when it has no pose of its own.
      if (!poses.has(R) && !poses.has(T) && i > 0) continue;
      if (poses.has(R) || poses.has(T)) set_pose(calibration_.cameras[i], poses, R, T);
      with_pose.push_back(calibration_.cameras[i]);
    }
    if (with_pose.size() < all)
      calibration_.notes.emplace_back(
          fmt::format("{} of {} cameras have no pose and were left out.", all - with_pose.size(), all));
    calibration_.cameras = std::move(with_pose);
  }

  static void set_pose(Camera& camera, const OpenCvStereoFile& poses, const std::string& R, const std::string& T) {
    const std::vector<double> rotation = poses.numbers(R, 0), translation = poses.numbers(T, 3);
    if (rotation.size() == 9) {
      camera.R = repaired_rotation(matrix_from_rows(rotation));
    } else if (rotation.size() == 3) {
      camera.R = rotation_from_vector(Eigen::Map<const Eigen::Vector3d>(rotation.data()));
    } else {
      poses.refuse(fmt::format("{} has {} numbers, expected a matrix of 9 or a vector of 3", R, rotation.size()));
    }
    camera.t = Eigen::Map<const Eigen::Vector3d>(translation.data());
  }

  /// What OpenCV's multiview_calibration.py saves: arrays with one row per camera.
  void read_stacked() {
    const std::vector<double> K = file_.numbers("Ks", 0);
    const std::size_t count = K.size() / 9;
    if (count == 0 || K.size() % 9 != 0 || count > kOpenCvStereoMaxCameras)
      file_.refuse(
          fmt::format("Ks has {} numbers, expected 9 for each of 1 to {} cameras", K.size(), kOpenCvStereoMaxCameras));
    const std::vector<double> distortion = file_.numbers("distortions", 0);
    if (distortion.size() % count != 0)
      file_.refuse(fmt::format("distortions has {} numbers for {} cameras", distortion.size(), count));
    const std::vector<double> R = file_.numbers("rvecs", 3 * count),
                              T = file_.numbers(file_.key_of({"Ts", "tvecs"}), 3 * count);
    const std::vector<double> fisheye = optional_numbers("is_fisheye", count),
                              sizes = optional_numbers("image_sizes", 2 * count);
    const std::vector<std::string> names = stacked_names(count);
    const std::size_t coefficients = distortion.size() / count;
    for (std::size_t i = 0; i < count; ++i) {
      Camera camera;
      camera.name = names[i];
      camera.K = intrinsics(std::span(K).subspan(9 * i, 9), PixelCentre::integer, file_.where());
      set_distortion(camera, !fisheye.empty() && fisheye[i] != 0 ? Lens::fisheye : Lens::opencv,
                     std::span(distortion).subspan(coefficients * i, coefficients), file_.where());
      camera.R = rotation_from_vector(Eigen::Map<const Eigen::Vector3d>(&R[3 * i]));
      camera.t = Eigen::Map<const Eigen::Vector3d>(&T[3 * i]);
      if (!sizes.empty()) set_size(camera, {sizes[2 * i], sizes[2 * i + 1]}, "image_sizes");
      calibration_.cameras.push_back(std::move(camera));
    }
  }

  std::vector<double> optional_numbers(const std::string& key, std::size_t count) const {
    return file_.has(key) ? file_.numbers(key, count) : std::vector<double>();
  }

  /// The names of cam_ids ("0,1,2"), or the numbers of the rows.
  std::vector<std::string> stacked_names(std::size_t count) const {
    std::vector<std::string> names;
    std::string ids = file_.text("cam_ids");
    for (std::size_t begin = 0; begin <= ids.size() && !ids.empty();) {
      const std::size_t end = std::min(ids.find(',', begin), ids.size());
      names.push_back(ids.substr(begin, end - begin));
      begin = end + 1;
    }
    if (names.size() == count) return names;
    names.clear();
    for (std::size_t i = 0; i < count; ++i) names.push_back(std::to_string(i));
    return names;
  }

  const OpenCvStereoFile& file_;
  const OpenCvStereoFile* extrinsics_ = nullptr;
  Calibration calibration_;
};

/// The other one of intrinsics.yml and extrinsics.yml, also when both have a number or another extension.
fs::path opencv_stereo_partner(const fs::path& path, const std::string& from, const std::string& to) {
  std::string name = path.filename().string();
  const std::size_t at = name.find(from);
  if (at == std::string::npos) return path.parent_path() / (to + "nsics.yml");
  return path.parent_path() / name.replace(at, from.size(), to);
}

/// Whether the text is a file of FileStorage with a top-level node of this name.
bool opencv_stereo_has_node(std::string_view head, const std::string& key) {
  if (head.starts_with("%YAML")) return head.find("\n" + key + ":") != head.npos;
  if (head.starts_with('{')) return head.find("\"" + key + "\"") != head.npos;
  return head.find("<" + key + ">") != head.npos || head.find("<" + key + " ") != head.npos;
}

/// The files of OpenCV's calibration programs.
/// - stereo_calib: K1 D1 K2 D2 (older versions M1, M2) in intrinsics.yml, R and T in extrinsics.yml beside it, or all
/// in
///   one file. Camera 1 is the world: X_cam2 = R X_cam1 + T. R1, R2, P1 and P2 there belong to rectified images.
/// - The same with more cameras: K1 ... Kn, D1 ... Dn, and R1, T1 ... Rn, Tn from the world to the camera.
/// - multiview_calibration.py: arrays Ks, distortions, rvecs, Ts with one row per camera; camera 0 is the world.
/// - calibration and camera_calibration: camera_matrix, distortion_coefficients and the image size of one camera, and
///   the interactive calibration with other names. Their extrinsic_parameters are poses of the board, not of the
///   camera.
/// Lengths have the unit in which the user gave the size of the squares, which the files do not say; pixel centres are
/// at integers. Doppel's own files have one map per camera and none of these nodes.
class OpenCvStereoCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "opencv_stereo"; }

  bool recognises(const CalibrationSource& source) const override {
    std::string_view head = source.head;
    if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
    head.remove_prefix(std::min(head.find_first_not_of(" \t\r\n"), head.size()));
    const bool is_storage =
        head.starts_with("%YAML") || head.starts_with('{') || head.find("<opencv_storage>") != head.npos;
    if (!is_storage || (head.find("opencv-matrix") == head.npos && head.find("opencv-nd-matrix") == head.npos))
      return false;
    const auto has = [&](const char* key) { return opencv_stereo_has_node(head, key); };
    for (const char* key : {"camera_matrix", "cameraMatrix", "Camera_Matrix", "K0", "K1", "M0", "M1", "Ks"}) {
      if (has(key)) return true;
    }
    return has("R") && has("T");
  }

  Calibration read(const CalibrationSource& source) const override {
    const OpenCvStereoFile file(source.path);
    const bool has_intrinsics = OpenCvStereoReader::has_numbered_intrinsics(file);
    const bool has_poses = OpenCvStereoReader::has_poses(file);
    if (has_intrinsics == has_poses) return OpenCvStereoReader(file).read();
    const fs::path partner = has_intrinsics ? opencv_stereo_partner(file.path(), "intri", "extri")
                                            : opencv_stereo_partner(file.path(), "extri", "intri");
    std::error_code ignored;
    if (partner == file.path() || !fs::exists(partner, ignored)) {
      if (has_intrinsics) return OpenCvStereoReader(file).read();
      file.refuse(fmt::format("the file has no intrinsics, and there is no {} beside it", partner.filename().string()));
    }
    const OpenCvStereoFile other(partner);
    OpenCvStereoReader reader(has_intrinsics ? file : other);
    reader.set_extrinsics(has_intrinsics ? &other : &file);
    return reader.read();
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_opencv_stereo_calibration() {
  return std::make_unique<OpenCvStereoCalibration>();
}

}  // namespace doppel
