#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/lower_case.h"

namespace doppel {
namespace {

using Human36mJson = nlohmann::json;

constexpr double kHuman36mMetresPerUnit = 0.001;
constexpr int kHuman36mFoldersAbove = 2;  // of a file, whose names may be that of the subject

struct Human36mSize {
  const char* camera;
  int width, height;
};
/// The four cameras of the dataset; most files do not state the sizes of their images.
constexpr Human36mSize kHuman36mSizes[] = {
    {"54138969", 1000, 1002}, {"55011271", 1000, 1000}, {"58860488", 1000, 1000}, {"60457274", 1000, 1002}};

/// What a file says about one camera: objects of the file, or null.
struct Human36mEntry {
  std::string name;
  const Human36mJson* intrinsics;
  const Human36mJson* pose;
};

bool is_human36m_pose(const Human36mJson& item) { return item.contains("R") || item.contains("orientation"); }
bool is_human36m_camera(const Human36mJson& item) {
  return is_human36m_pose(item) || item.contains("f") || item.contains("focal_length");
}

/// The items of an object or a list with their names: the keys, or the `id` of each item, or its number.
std::vector<std::pair<std::string, const Human36mJson*>> human36m_items(const Human36mJson& container) {
  std::vector<std::pair<std::string, const Human36mJson*>> items;
  for (const auto& [key, value] : container.items()) {
    const auto id = container.is_array() && value.is_object() ? value.find("id") : value.end();
    const bool named = container.is_array() && value.is_object() && id != value.end();
    items.emplace_back(!named ? key : id->is_string() ? id->get<std::string>() : id->dump(), &value);
  }
  // nlohmann sorts the keys as text; S9 comes before S11.
  if (container.is_object())
    std::sort(items.begin(), items.end(), [](const auto& a, const auto& b) {
      return a.first.size() != b.first.size() ? a.first.size() < b.first.size() : a.first < b.first;
    });
  return items;
}

/// The words of a name in lower case: "S9-Walking" has "s9" and "walking".
std::vector<std::string> human36m_words(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : lower_case(name)) {
    if (std::isalnum(static_cast<unsigned char>(c)))
      words.back() += c;
    else
      words.emplace_back();
  }
  return words;
}

/// The cameras of the subjects by their names in lower case.
using Human36mSubjects = std::map<std::string, std::pair<std::string, const Human36mJson*>>;

/// The subjects that the name of a file or folder holds as a word.
std::set<std::string> subjects_in_name(const Human36mSubjects& subjects, const std::string& name) {
  std::set<std::string> found;
  for (const std::string& word : human36m_words(name))
    if (subjects.contains(word)) found.insert(word);
  return found;
}

/// The subject that the path names: by the file or, without one, by the folder or by the folder above. A name with
/// several subjects names none. Farther folders are not asked: "s1" may be the name of a computer's user.
std::string subject_of_path(const Human36mSubjects& subjects, const std::filesystem::path& path) {
  std::filesystem::path part = std::filesystem::absolute(path);
  part.replace_extension();
  for (int level = 0; level <= kHuman36mFoldersAbove; ++level, part = part.parent_path()) {
    if (part.filename() == ".") part = part.parent_path();
    const std::set<std::string> found = subjects_in_name(subjects, part.filename().string());
    if (found.size() == 1) return *found.begin();
  }
  return "";
}

/// Reads one file of any layout; every message names the camera and the key.
class Human36mReader {
 public:
  explicit Human36mReader(const CalibrationSource& source)
      : path_(source.path), subject_(source.subject), where_{source.path.string(), 0} {}

  Calibration read() {
    const Human36mJson root = read_json(where_.file);
    const bool split = root.contains("intrinsics") && root.contains("extrinsics");
    const Human36mJson& cameras = cameras_of_subject(split ? root["extrinsics"] : root);
    const std::vector<Human36mEntry> entries = split ? paired(root["intrinsics"], cameras) : whole(cameras);
    for (const Human36mEntry& entry : entries)
      if (entry.pose) calibration_.cameras.push_back(read_camera(entry));
    if (calibration_.cameras.empty()) fail_at(where_, "reading a camera calibration: no camera has a pose");
    const std::size_t read = calibration_.cameras.size(), most = std::max(entries.size(), cameras.size());
    if (read < most)
      calibration_.notes.emplace_back(
          fmt::format("{} cameras were left out, because their pose or their intrinsics are missing", most - read));
    calibration_.unit = "mm";
    calibration_.up = "+z";
    return std::move(calibration_);
  }

 private:
  /// The cameras of the subject; `container` itself when it holds cameras.
  const Human36mJson& cameras_of_subject(const Human36mJson& container) {
    if (!container.is_structured() || container.empty())
      fail_at(where_, "reading a camera calibration: the file must hold cameras by their names, or a list of them");
    const auto items = human36m_items(container);
    const auto holds_cameras = [](const auto& item) { return is_human36m_camera(*item.second); };
    if (std::any_of(items.begin(), items.end(), holds_cameras)) {
      if (!subject_.empty())
        fail<UsageError>("{}: the subject \"{}\" is named, but this file does not tell subjects apart", where_.file,
                         subject_);
      return container;
    }
    Human36mSubjects subjects;
    for (const auto& [name, cameras] : items)
      if (cameras->is_structured() && std::any_of(cameras->begin(), cameras->end(), is_human36m_pose))
        subjects.try_emplace(lower_case(name), name, cameras);
    if (subjects.empty())
      fail_at(where_, "reading a camera calibration: no camera has a pose (R and t, or orientation and translation)");
    const auto& [name, cameras] = chosen_subject(subjects);
    if (items.size() > 1)
      calibration_.notes.emplace_back(fmt::format(
          "the file holds {} subjects, whose cameras stood differently; those of {} were taken", items.size(), name));
    return *cameras;
  }

  /// The subject that the user names, or the only one with poses, or the one that the path names.
  const std::pair<std::string, const Human36mJson*>& chosen_subject(const Human36mSubjects& subjects) const {
    std::vector<std::string> names;
    for (const auto& [key, subject] : subjects) names.push_back(subject.first);
    const std::string known = excerpt(fmt::format("{}", fmt::join(names, ", ")), 200);
    if (subject_.empty() && subjects.size() == 1) return subjects.begin()->second;
    const std::string key = subject_.empty() ? subject_of_path(subjects, path_) : lower_case(subject_);
    const auto found = subjects.find(key);
    if (found != subjects.end()) return found->second;
    if (!subject_.empty())
      fail<UsageError>("{}: there are no cameras of the subject \"{}\"; the file has those of {}", where_.file,
                       subject_, known);
    fail_at(
        where_,
        "reading a camera calibration: the file holds the cameras of {} subjects ({}), which stood differently, and "
        "neither its name nor its folder names one of them. Put it into the folder of the subject ({}/), or name "
        "the subject: `subject` in capture.yaml, or --subject",
        names.size(), known, excerpt(names.front()));
  }

  /// Cameras whose intrinsics and poses stand in one object.
  static std::vector<Human36mEntry> whole(const Human36mJson& cameras) {
    std::vector<Human36mEntry> entries;
    for (const auto& [name, item] : human36m_items(cameras))
      entries.push_back({name, item, is_human36m_pose(*item) ? item : nullptr});
    return entries;
  }

  /// Cameras whose intrinsics and poses stand apart; lists pair by position when the poses have no `id`.
  static std::vector<Human36mEntry> paired(const Human36mJson& intrinsics, const Human36mJson& poses) {
    const auto items = human36m_items(poses);
    std::vector<Human36mEntry> entries;
    std::size_t position = 0;
    for (const auto& [name, item] : human36m_items(intrinsics)) {
      const std::string listed_number = std::to_string(position++);
      const auto pose = std::find_if(items.begin(), items.end(), [&, &own_name = name](const auto& other) {
        return other.first == own_name || (poses.is_array() && other.first == listed_number);
      });
      const bool posed = pose != items.end() && is_human36m_pose(*pose->second);
      entries.push_back({name, item, posed ? pose->second : nullptr});
    }
    return entries;
  }

  Camera read_camera(const Human36mEntry& entry) const {
    Camera camera;
    camera.name = entry.name;
    if (!entry.intrinsics->is_object())
      fail_at(where_, "reading a camera calibration: camera {}: must be an object", camera.name);
    read_size(*entry.intrinsics, camera);
    read_lens(*entry.intrinsics, camera);
    read_pose(*entry.pose, camera);
    return camera;
  }

  void read_size(const Human36mJson& item, Camera& camera) const {
    if (item.contains("res_w") || item.contains("res_h")) {
      camera.width = side(item, "res_w", camera);
      camera.height = side(item, "res_h", camera);
      return;
    }
    for (const Human36mSize& size : kHuman36mSizes) {
      if (camera.name != size.camera) continue;
      camera.width = size.width;
      camera.height = size.height;
    }
  }

  void read_lens(const Human36mJson& item, Camera& camera) const {
    if (item.contains("calibration_matrix")) {
      camera.K = intrinsics(list(item, "calibration_matrix", 9, camera), PixelCentre::integer, where_);
      if (item.contains("distortion"))
        set_distortion(camera, Lens::opencv, list(item, "distortion", 0, camera), where_);
      return;
    }
    const bool has_long_names = item.contains("focal_length");
    const std::vector<double> f = list(item, has_long_names ? "focal_length" : "f", 2, camera),
                              c = list(item, has_long_names ? "center" : "c", 2, camera);
    camera.K = intrinsics(f[0], f[1], c[0], c[1], PixelCentre::integer);
    const char* const radial = has_long_names ? "radial_distortion" : "k";
    const char* const tangential = has_long_names ? "tangential_distortion" : "p";
    if (!item.contains(radial) && !item.contains(tangential)) return;
    const std::vector<double> k = list(item, radial, 3, camera), p = list(item, tangential, 2, camera);
    const double p1 = has_long_names ? p[1] : p[0], p2 = has_long_names ? p[0] : p[1];
    set_distortion(camera, Lens::opencv, std::vector<double>{k[0], k[1], p1, p2, k[2]}, where_);
  }

  void read_pose(const Human36mJson& item, Camera& camera) const {
    if (item.contains("orientation")) {
      const std::vector<double> q = list(item, "orientation", 4, camera);
      set_pose_at(camera, rotation_from_quaternion(q[0], q[1], q[2], q[3], where_).transpose(),
                  metres(item, "translation", camera));
      return;
    }
    const Eigen::Matrix3d R = repaired_rotation(matrix_from_rows(list(item, "R", 9, camera)));
    if (!item.contains("t") && item.contains("T")) {
      set_pose_at(camera, R, metres(item, "T", camera));
      return;
    }
    camera.R = R;
    camera.t = metres(item, "t", camera);
  }

  Eigen::Vector3d metres(const Human36mJson& item, const char* key, const Camera& camera) const {
    const std::vector<double> mm = list(item, key, 3, camera);
    return kHuman36mMetresPerUnit * Eigen::Vector3d(mm[0], mm[1], mm[2]);
  }

  std::vector<double> list(const Human36mJson& item, const char* key, std::size_t count, const Camera& camera) const {
    return numbers(item.value(key, Human36mJson()), count, fmt::format("camera {}: {}", camera.name, key), where_);
  }

  int side(const Human36mJson& item, const char* key, const Camera& camera) const {
    const std::string what = fmt::format("camera {}: {}", camera.name, key);
    return image_side(number(item, key, what, where_), what, where_);
  }

  std::filesystem::path path_;
  std::string subject_;
  FileLocation where_;
  Calibration calibration_;
};

/// The camera parameters of Human3.6M as JSON, in millimetres, z up, with the centre of the first pixel taken to be
/// (0, 0). The keys decide:
/// - `R` and `t`: X_cam = R X + t. `R` and `T`: T is the centre of the camera, X_cam = R (X - T).
/// - `orientation` and `translation` (VideoPose3D): a quaternion w x y z world from camera, and the camera's centre.
/// - `f`, `c`, `k` (k1 k2 k3), `p` (p1 p2), or `calibration_matrix` and `distortion` (k1 k2 p1 p2 k3), or VideoPose3D's
///   `focal_length`, `center`, `radial_distortion`, `tangential_distortion`, which is p2 p1, in this order.
/// Cameras stand in an object by their names or in a list, both with or without one level of subjects above, or in
/// `intrinsics` and `extrinsics` (camera-parameters.json). The rig stood differently for every subject, so the subject
/// is the one that the user names, or that the path names.
/// The dataset's own projection halves the terms 2 p1 x y and 2 p2 x^2 of OpenCV, less than a pixel; this reader takes
/// OpenCV's model, as the programs do that undistort these images.
class Human36mCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "human36m"; }
  bool recognises(const CalibrationSource& source) const override {
    const std::size_t begin = source.head.find_first_of("[{");
    if (begin == std::string::npos || source.head.find_first_not_of(" \t\r\n\xEF\xBB\xBF") != begin) return false;
    return (source.has("\"R\"") && source.has("\"f\"") && source.has("\"c\"")) ||
           (source.has("\"intrinsics\"") && source.has("\"calibration_matrix\"")) ||
           (source.has("\"focal_length\"") && source.has("\"center\"") && source.has("\"radial_distortion\""));
  }
  Calibration read(const CalibrationSource& source) const override { return Human36mReader(source).read(); }
  bool has_subjects() const override { return true; }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_human36m_calibration() { return std::make_unique<Human36mCalibration>(); }

}  // namespace doppel
