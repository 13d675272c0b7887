#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <unordered_map>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/file_storage.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/excerpt.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kOpenCvStereoMaxCameras = 1000;
constexpr double kMinFocalLength = 2.0;   // pixels; no row of a rotation is as long
constexpr double kSameIntrinsics = 1e-6;  // relative difference of two files' numbers
constexpr int kUnsided = -1;

/// Names of one thing, in lower case and without what stands between words. A name of one letter is upper case in the
/// file, because k1 is a coefficient of a lens.
using StereoNames = std::span<const std::string_view>;
constexpr std::string_view kStereoMatrix[] = {"k",
                                              "m",
                                              "cameramatrix",
                                              "cammatrix",
                                              "cameramat",
                                              "cammat",
                                              "mtx",
                                              "kmatrix",
                                              "kmat",
                                              "intrinsicmatrix",
                                              "intrinsicsmatrix",
                                              "cameraintrinsics",
                                              "cameraintrinsic",
                                              "intrinsics",
                                              "intrinsic",
                                              "intrmatrix"};
constexpr std::string_view kStereoDistortion[] = {"d",
                                                  "dist",
                                                  "distcoeffs",
                                                  "distcoeff",
                                                  "distcoefs",
                                                  "distcoef",
                                                  "distortion",
                                                  "distortions",
                                                  "distortioncoefficients",
                                                  "distortioncoefficient",
                                                  "distortioncoeffs",
                                                  "distortioncoeff",
                                                  "distortioncoefs",
                                                  "distcoefficients",
                                                  "distvec",
                                                  "cameradistortion",
                                                  "cameradistcoeffs"};
constexpr std::string_view kStereoRotation[] = {"r",      "rotation", "rotationmatrix", "rotmatrix",
                                                "rotmat", "rot",      "rvec",           "rotationvector"};
constexpr std::string_view kStereoTranslation[] = {
    "t", "translation", "translationvector", "translationmatrix", "tvec", "trans", "tvector"};
constexpr std::string_view kStereoSize[] = {"imagesize",  "imgsize",    "framesize",      "cameraresolution",
                                            "resolution", "imageshape", "imageresolution"};
constexpr std::string_view kStereoWidth[] = {"imagewidth", "framewidth", "imgwidth", "width"};
constexpr std::string_view kStereoHeight[] = {"imageheight", "frameheight", "imgheight", "height"};

/// A key as it stands in a file, and the camera it belongs to.
struct StereoKey {
  std::string key;
  std::string camera;  ///< "left" and "right", or the number as it is written
};

/// The keys of one thing by the cameras: the number in the key, 1 for left, 2 for right; kUnsided without any.
using StereoKeys = std::map<int, StereoKey>;

bool is_one_of(StereoNames names, std::string_view squeezed, std::string_view key) {
  if (std::find(names.begin(), names.end(), squeezed) == names.end()) return false;
  return squeezed.size() > 1 || key.find(static_cast<char>(std::toupper(squeezed[0]))) != key.npos;
}

/// The camera of a key that is one of the names with or without a camera: cameraMatrix1, camera_matrix_left, leftK, KL.
std::optional<std::pair<int, std::string>> stereo_camera_of(const std::string& key, StereoNames names) {
  constexpr std::size_t kMaxDigits = 4;
  std::string squeezed;
  for (const unsigned char c : key)
    if (std::isalnum(c)) squeezed += static_cast<char>(std::tolower(c));
  if (is_one_of(names, squeezed, key)) return std::pair(kUnsided, std::string());
  const auto without = [&](std::size_t at, std::size_t length) { return std::string(squeezed).erase(at, length); };
  const std::size_t digit = squeezed.find_first_of("0123456789");
  if (digit != squeezed.npos) {
    const std::size_t end = std::min(squeezed.find_first_not_of("0123456789", digit), squeezed.size());
    const std::string number = squeezed.substr(digit, end - digit);
    if (number.size() > kMaxDigits || !is_one_of(names, without(digit, number.size()), key)) return std::nullopt;
    return std::pair(std::stoi(number), number);
  }
  for (const auto& [word, index] : {std::pair<std::string, int>("left", 1), {"right", 2}}) {
    if (const std::size_t at = squeezed.find(word);
        at != squeezed.npos && is_one_of(names, without(at, word.size()), key))
      return std::pair(index, word);
    if (squeezed.size() < 2) continue;
    if ((squeezed.back() == word[0] && is_one_of(names, without(squeezed.size() - 1, 1), key)) ||
        (squeezed.front() == word[0] && is_one_of(names, without(0, 1), key)))
      return std::pair(index, word);
  }
  return std::nullopt;
}

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

  /// The keys with one of these names; of several for one camera, the first one.
  StereoKeys keys_of(StereoNames names) const {
    StereoKeys keys;
    for (const auto& [key, value] : root_.members)
      if (const auto camera = stereo_camera_of(key, names))
        keys.try_emplace(camera->first, StereoKey{key, camera->second});
    return keys;
  }

  /// The keys of matrices that can only be intrinsics: [f s x; 0 f y; 0 0 1].
  std::vector<std::string> keys_like_intrinsics() const {
    std::vector<std::string> keys;
    for (const auto& [key, value] : root_.members) {
      const StorageValue& data = value["data"].is_none() ? value : value["data"];
      std::vector<double> m;
      for (const StorageValue& item : data.items) m.push_back(item.number);
      if (m.size() == 9 && m[3] == 0 && m[6] == 0 && m[7] == 0 && m[8] == 1 && m[0] > kMinFocalLength &&
          m[4] > kMinFocalLength)
        keys.push_back(key);
    }
    return keys;
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
  explicit OpenCvStereoReader(const OpenCvStereoFile& file)
      : file_(file), matrices_(file.keys_of(kStereoMatrix)), distortions_(file.keys_of(kStereoDistortion)) {}

  Calibration read() {
    if (matrices_.contains(kUnsided)) {
      read_single();
    } else if (file_.has("Ks")) {
      read_stacked();
    } else if (!matrices_.empty()) {
      read_several();
    } else {
      file_.refuse(
          "the file has no intrinsics; expected camera_matrix, K1 and K2 (or M1 and M2), cameraMatrix1 and "
          "cameraMatrix2, camera_matrix_left and camera_matrix_right, or Ks");
    }
    return std::move(calibration_);
  }

  /// The pair R, T or the numbered R1, T1, ... Without T1 and T2, R1 and R2 are the rotations of the rectification.
  static bool has_poses(const OpenCvStereoFile& file) {
    const StereoKeys rotations = file.keys_of(kStereoRotation), translations = file.keys_of(kStereoTranslation);
    return std::any_of(rotations.begin(), rotations.end(),
                       [&](const auto& rotation) { return translations.contains(rotation.first); });
  }
  static bool has_intrinsics(const OpenCvStereoFile& file) {
    return file.has("Ks") || !file.keys_of(kStereoMatrix).empty();
  }
  /// Whether the intrinsics are those of several cameras, whose poses may lie in another file.
  static bool has_several(const OpenCvStereoFile& file) {
    const StereoKeys matrices = file.keys_of(kStereoMatrix);
    return !matrices.empty() && !matrices.contains(kUnsided) && !file.has("Ks");
  }
  /// @param extrinsics the file with the poses; without one, they are sought in the file of the intrinsics
  void set_extrinsics(const OpenCvStereoFile* extrinsics) { extrinsics_ = extrinsics; }

 private:
  Lens lens() const {
    return file_.has("fisheye_model") && file_.number("fisheye_model") != 0 ? Lens::fisheye : Lens::opencv;
  }

  Camera intrinsics_of(const std::string& name, int index, const std::string& distortion) const {
    Camera camera;
    camera.name = name;
    camera.K = intrinsics(file_.numbers(matrices_.at(index).key, 9), PixelCentre::integer, file_.where());
    set_distortion(camera, lens(), file_.numbers(distortion, 0), file_.where());
    const auto own_key = [&](StereoNames names) {
      const StereoKeys keys = file_.keys_of(names);
      const auto own = keys.contains(index) ? keys.find(index) : keys.find(kUnsided);
      return own != keys.end() ? own->second.key : std::string();
    };
    if (const std::string size = own_key(kStereoSize); !size.empty()) {
      set_size(camera, file_.numbers(size, 2), size);
    } else if (const std::string width = own_key(kStereoWidth); !width.empty()) {
      const std::string height = own_key(kStereoHeight);
      if (height.empty()) file_.refuse(fmt::format("the file has {}, but image_height is missing", width));
      set_size(camera, {file_.number(width), file_.number(height)}, width + " or " + height);
    }
    return camera;
  }

  void set_size(Camera& camera, const std::vector<double>& size, const std::string& key) const {
    camera.width = image_side(size[0], key, file_.where());
    camera.height = image_side(size[1], key, file_.where());
  }

  void read_single() {
    const auto distortion = distortions_.find(kUnsided);
    calibration_.cameras.push_back(
        intrinsics_of(file_.path().stem().string(), kUnsided,
                      distortion != distortions_.end() ? distortion->second.key : "distortion_coefficients"));
    calibration_.has_poses = false;
  }

  void read_several() {
    if (matrices_.size() > kOpenCvStereoMaxCameras)
      file_.refuse(fmt::format("the file has more than {} cameras", kOpenCvStereoMaxCameras));
    for (const auto& [index, matrix] : matrices_) {
      const auto distortion = distortions_.find(index);
      calibration_.cameras.push_back(intrinsics_of(
          matrix.camera, index, distortion != distortions_.end() ? distortion->second.key : "D" + matrix.camera));
    }
    const OpenCvStereoFile& poses = extrinsics_ != nullptr ? *extrinsics_ : file_;
    if (!has_poses(poses)) {
      calibration_.has_poses = false;
      calibration_.notes.emplace_back("There are no extrinsics (R and T), so the cameras have no poses.");
      return;
    }
    const StereoKeys rotations = poses.keys_of(kStereoRotation), translations = poses.keys_of(kStereoTranslation);
    const bool pair = rotations.contains(kUnsided) && translations.contains(kUnsided);
    if (pair && !(rotations.contains(2) && translations.contains(2)))
      set_pair(poses, rotations.at(kUnsided).key, translations.at(kUnsided).key);
    else
      set_numbered_poses(poses, rotations, translations);
  }

  void set_pair(const OpenCvStereoFile& poses, const std::string& R, const std::string& T) {
    if (calibration_.cameras.size() != 2) {
      file_.refuse(fmt::format("{} and {} of the extrinsics belong to two cameras, found the intrinsics of {}", R, T,
                               calibration_.cameras.size()));
    }
    set_pose(calibration_.cameras[1], poses, R, T);
  }

  void set_numbered_poses(const OpenCvStereoFile& poses, const StereoKeys& rotations, const StereoKeys& translations) {
    std::vector<Camera> with_pose;
    const std::size_t all = calibration_.cameras.size();
    auto matrix = matrices_.begin();
    for (std::size_t i = 0; i < all; ++i, ++matrix) {
      const auto R = rotations.find(matrix->first), T = translations.find(matrix->first);
      const bool has_rotation = R != rotations.end(), has_translation = T != translations.end();
      // The first camera is the world when it has no pose of its own.
      if (!has_rotation && !has_translation && i > 0) continue;
      if (has_rotation || has_translation)
        set_pose(calibration_.cameras[i], poses, has_rotation ? R->second.key : "R" + matrix->second.camera,
                 has_translation ? T->second.key : "T" + matrix->second.camera);
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
  StereoKeys matrices_, distortions_;
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

/// The keys in the beginning of a file of FileStorage: those at the beginning of a line of YAML, and all of XML or
/// JSON, where nested ones are not told apart.
std::vector<std::string> stereo_keys_in(std::string_view head) {
  const bool yaml = head.starts_with("%YAML"), json = head.starts_with('{');
  const std::string_view before = yaml ? "\n" : json ? "\"" : "<", after = yaml ? ":" : json ? "\"" : " >\t\r\n/";
  constexpr std::size_t kMaxKeyLength = 64;
  std::vector<std::string> keys;
  for (std::size_t at = head.find(before); at != head.npos; at = head.find(before, at)) {
    const std::string_view rest = head.substr(++at, kMaxKeyLength);
    const std::string_view key = rest.substr(0, std::min(rest.find_first_of(after), rest.size()));
    const bool is_key =
        !key.empty() && key.size() < rest.size() &&
        std::all_of(key.begin(), key.end(), [](unsigned char c) { return std::isalnum(c) || c == '_'; });
    if (is_key) keys.emplace_back(key);
  }
  return keys;
}

/// The files of OpenCV's calibration programs.
/// - stereo_calib: K1 D1 K2 D2 (older versions M1, M2) in intrinsics.yml, R and T in extrinsics.yml beside it, or all
///   in one file. Camera 1 is the world: X_cam2 = R X_cam1 + T. R1, R2, P1 and P2 there belong to rectified images.
/// - The same with the names of cv::stereoCalibrate's arguments (cameraMatrix1, distCoeffs1, ...), or with left and
///   right instead of the numbers.
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
    bool has_matrix = false, has_rotation = false, has_translation = false;
    const auto is_pair = [](const std::string& key, StereoNames names) {
      const auto camera = stereo_camera_of(key, names);
      return camera && camera->first == kUnsided;
    };
    for (const std::string& key : stereo_keys_in(head)) {
      if (key == "names") return false;  // of EasyMocap
      // One letter alone is also a key of each camera in Doppel's own files.
      has_matrix |= key == "Ks" || (key.size() > 1 && stereo_camera_of(key, kStereoMatrix));
      has_rotation |= is_pair(key, kStereoRotation);
      has_translation |= is_pair(key, kStereoTranslation);
    }
    return has_matrix || (has_rotation && has_translation);
  }

  Calibration read(const CalibrationSource& source) const override {
    const OpenCvStereoFile file(source.path);
    const bool has_several = OpenCvStereoReader::has_several(file), has_poses = OpenCvStereoReader::has_poses(file);
    if (has_several && !has_poses) return with_extrinsics(file);
    if (has_poses && !OpenCvStereoReader::has_intrinsics(file)) return with_intrinsics(file);
    return OpenCvStereoReader(file).read();
  }

 private:
  /// Several cameras without poses, which extrinsics.yml beside the file may have.
  static Calibration with_extrinsics(const OpenCvStereoFile& file) {
    OpenCvStereoReader reader(file);
    const fs::path partner = opencv_stereo_partner(file.path(), "intri", "extri");
    std::error_code ignored;
    if (partner == file.path() || !fs::exists(partner, ignored)) return reader.read();
    const OpenCvStereoFile other(partner);
    // Poses of a file that has intrinsics of its own are those of its cameras.
    if (OpenCvStereoReader::has_intrinsics(other) && !has_same_intrinsics(file, other)) {
      Calibration alone = reader.read();
      alone.notes.push_back(fmt::format("{} beside the file has other intrinsics, so its poses are not taken",
                                        partner.filename().string()));
      return alone;
    }
    reader.set_extrinsics(&other);
    Calibration calibration = reader.read();
    return calibration.has_poses ? joined(std::move(calibration), "the poses", partner) : calibration;
  }

  static bool has_same_intrinsics(const OpenCvStereoFile& file, const OpenCvStereoFile& other) {
    const std::vector<Camera> own = OpenCvStereoReader(file).read().cameras,
                              theirs = OpenCvStereoReader(other).read().cameras;
    return std::equal(own.begin(), own.end(), theirs.begin(), theirs.end(), [](const Camera& a, const Camera& b) {
      return a.K.isApprox(b.K, kSameIntrinsics) && a.lens == b.lens;
    });
  }

  /// R and T without intrinsics, which intrinsics.yml beside the file must have.
  static Calibration with_intrinsics(const OpenCvStereoFile& file) {
    if (const std::vector<std::string> like = file.keys_like_intrinsics(); !like.empty())
      file.refuse(fmt::format(
          "{} looks like the intrinsics of a camera, but its name is not known; name them K1, D1, K2, D2, or "
          "cameraMatrix1, distCoeffs1, ..., or camera_matrix_left, dist_coeffs_left, ...",
          excerpt(like.front())));
    const fs::path partner = opencv_stereo_partner(file.path(), "extri", "intri");
    std::error_code ignored;
    if (partner == file.path() || !fs::exists(partner, ignored))
      file.refuse(fmt::format("the file has no intrinsics, and there is no {} beside it", partner.filename().string()));
    const OpenCvStereoFile other(partner);
    OpenCvStereoReader reader(other);
    reader.set_extrinsics(&file);
    return joined(reader.read(), "the intrinsics", partner);
  }

  static Calibration joined(Calibration calibration, const char* part, const fs::path& partner) {
    calibration.notes.push_back(fmt::format("{} are those of {} beside the file", part, partner.filename().string()));
    return calibration;
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_opencv_stereo_calibration() {
  return std::make_unique<OpenCvStereoCalibration>();
}

}  // namespace doppel
