#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string_view>
#include <unordered_map>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/file_head.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/camera.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kEasyMocapMaxBytes = 64 << 20;
constexpr std::size_t kEasyMocapHeadBytes = 16 << 10;
constexpr std::size_t kEasyMocapCoefficients = 5;
// EasyMocap writes 6 digits, so its matrices are rotations to 1e-6 only. A matrix with all digits is better than the
// vector beside it, whose rotation has rounding errors of its own.
constexpr double kEasyMocapAllDigits = 1e-9;
constexpr double kEasyMocapSameRotation = 1e-3;
constexpr std::string_view kEasyMocapBlanks = " \t\r\n";

std::string_view easymocap_trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kEasyMocapBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kEasyMocapBlanks) - begin + 1);
}

bool easymocap_is_key_start(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

/// The top-level entries of intri.yml or extri.yml. These files are no plain YAML ("%YAML:1.0", "!!opencv-matrix"), but
/// each of their lines that begins with a letter is the key of an entry, and the lines below it are its value.
class EasyMocapFile {
 public:
  explicit EasyMocapFile(const fs::path& path) : path_(path), text_(read_file(path, kEasyMocapMaxBytes)) {
    if (text_.find('\0') != std::string::npos) refuse(0, "this is not a text file (found a NUL byte)");
    if (text_.starts_with("\xEF\xBB\xBF")) text_.erase(0, 3);
    find_entries();
  }
  ~EasyMocapFile() = default;
  EasyMocapFile(const EasyMocapFile&) = delete;  // the entries point into the text
  EasyMocapFile& operator=(const EasyMocapFile&) = delete;

  const fs::path& path() const { return path_; }
  bool has(const std::string& key) const { return entries_.contains(key); }
  bool has_key_like(std::string_view begin) const {
    return std::any_of(entries_.begin(), entries_.end(),
                       [&](const auto& item) { return item.first.starts_with(begin); });
  }
  FileLocation where(const std::string& key) const { return {path_.string(), entry(key).line}; }

  std::vector<std::string> names() const {
    const Entry& list = entry("names");
    std::vector<std::string> found;
    std::set<std::string> seen;
    for (const std::string_view item : items_of(list.value)) {
      const std::string name(item);
      if (name.empty()) refuse(list.line, "names holds an empty name");
      if (!seen.insert(name).second) refuse(list.line, fmt::format("names holds \"{}\" twice", name));
      if (name != "none") found.push_back(name);
    }
    if (found.empty()) refuse(list.line, "names holds no camera");
    return found;
  }

  /// The numbers of a matrix or list. @param count how many there must be, or 0
  std::vector<double> matrix(const std::string& key, std::size_t count) const {
    const Entry& found = entry(key);
    const std::size_t begin = found.value.find('['), end = found.value.find(']');
    if (begin == std::string_view::npos || end == std::string_view::npos || end < begin)
      refuse(found.line, fmt::format("{} must be a matrix, with its numbers in [ ]", key));
    const std::vector<double> numbers = numbers_of(key, found, found.value.substr(begin + 1, end - begin - 1));
    const std::string_view head = found.value.substr(0, begin);
    const std::optional<double> rows = field(head, "rows:"), cols = field(head, "cols:");
    const bool promised = !rows || !cols || *rows * *cols == static_cast<double>(numbers.size());
    if (!promised || (count != 0 && numbers.size() != count)) {
      refuse(found.line, fmt::format("{} has {} numbers, expected {}", key, numbers.size(),
                                     count ? std::to_string(count) : "rows x cols"));
    }
    return numbers;
  }

  /// A side of the images in pixels, 0 when the file does not say it (some writers say -1 then).
  int side(const std::string& key) const {
    if (!has(key)) return 0;
    const Entry& found = entry(key);
    const std::optional<double> value = parse_number(easymocap_trimmed(found.value));
    if (!value || *value != std::floor(*value) || std::abs(*value) > kMaxImageSide) {
      refuse(found.line, fmt::format("{} is \"{}\", expected an integer up to {}", key,
                                     easymocap_trimmed(found.value.substr(0, 40)), kMaxImageSide));
    }
    return std::max(0, static_cast<int>(*value));
  }

 private:
  struct Entry {
    std::string_view value;
    int line = 0;
  };

  [[noreturn]] void refuse(int line, const std::string& fault) const {
    fail_at({path_.string(), line}, "reading a camera calibration: {}", fault);
  }

  void find_entries() {
    const std::string_view text = text_;
    Entry* open = nullptr;
    int number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      const std::string_view line = text.substr(begin, end - begin);
      ++number;
      if (!line.empty() && easymocap_is_key_start(line.front())) {
        open = add_entry(line, number);
      } else if (open != nullptr) {
        open->value = std::string_view(open->value.data(), as_length(open->value.data(), line.data() + line.size()));
      }
      begin = end + 1;
    }
  }

  static std::size_t as_length(const char* begin, const char* end) { return static_cast<std::size_t>(end - begin); }

  Entry* add_entry(std::string_view line, int number) {
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos)
      refuse(number, fmt::format("expected \"key: value\", found \"{}\"", line.substr(0, 40)));
    const std::string key(easymocap_trimmed(line.substr(0, colon)));
    const auto [slot, is_new] = entries_.try_emplace(key, Entry{line.substr(colon + 1), number});
    if (!is_new) refuse(number, fmt::format("{} stands in this file twice", key));
    return &slot->second;
  }

  const Entry& entry(const std::string& key) const {
    const auto found = entries_.find(key);
    if (found == entries_.end()) refuse(0, fmt::format("{} is missing", key));
    return found->second;
  }

  /// The items of [ "a", "b" ] or of lines that begin with a dash, without quotation marks.
  static std::vector<std::string_view> items_of(std::string_view value) {
    const std::size_t open = value.find('[');
    const bool in_brackets = open != std::string_view::npos && value.find('-') > open;
    if (in_brackets) value = value.substr(open + 1, value.find(']') - open - 1);
    std::vector<std::string_view> items;
    for (std::size_t begin = 0; begin < value.size();) {
      const std::size_t end = std::min(value.find(in_brackets ? ',' : '\n', begin), value.size());
      std::string_view item = easymocap_trimmed(value.substr(begin, end - begin));
      begin = end + 1;
      if (!in_brackets && !item.starts_with('-')) continue;
      if (!in_brackets) item = easymocap_trimmed(item.substr(1));
      if (item.size() >= 2 && item.front() == item.back() && (item.front() == '"' || item.front() == '\''))
        item = item.substr(1, item.size() - 2);
      items.push_back(item);
    }
    return items;
  }

  std::vector<double> numbers_of(const std::string& key, const Entry& found, std::string_view text) const {
    constexpr std::string_view kBetween = ", \t\r\n";
    std::vector<double> numbers;
    for (std::size_t begin = text.find_first_not_of(kBetween); begin != std::string_view::npos;) {
      const std::size_t end = std::min(text.find_first_of(kBetween, begin), text.size());
      const std::string_view token = text.substr(begin, end - begin);
      const std::optional<double> number = parse_number(token);
      if (!number || !std::isfinite(*number))
        refuse(found.line, fmt::format("{} must hold finite numbers, found \"{}\"", key, token.substr(0, 40)));
      numbers.push_back(*number);
      begin = text.find_first_not_of(kBetween, end);
    }
    return numbers;
  }

  static std::optional<double> field(std::string_view text, std::string_view key) {
    const std::size_t at = text.find(key);
    if (at == std::string_view::npos) return std::nullopt;
    const std::string_view rest = text.substr(at + key.size());
    return parse_number(easymocap_trimmed(rest.substr(0, rest.find('\n'))));
  }

  fs::path path_;
  std::string text_;
  std::unordered_map<std::string, Entry> entries_;
};

/// Reads the cameras that both files know. X_cam = R_<name> X + T_<name>, with R_ a rotation vector, Rot_ the same as a
/// matrix, and T_ in metres; pixel centres as in OpenCV. Files give the size of the images only in newer versions.
class EasyMocapReader {
 public:
  EasyMocapReader(const EasyMocapFile& intri, const EasyMocapFile* extri) : intri_(intri), extri_(extri) {}

  Calibration read() const {
    Calibration calibration;
    calibration.unit = "m";
    calibration.has_poses = extri_ != nullptr;
    const std::vector<std::string> names = intri_.names();
    for (const std::string& name : names) {
      if (extri_ != nullptr && !has_pose(name)) continue;
      calibration.cameras.push_back(read_camera(name));
    }
    if (extri_ != nullptr) note_differences(names, calibration);
    return calibration;
  }

 private:
  bool has_pose(const std::string& name) const {
    return extri_->has("T_" + name) || extri_->has("R_" + name) || extri_->has("Rot_" + name);
  }

  Camera read_camera(const std::string& name) const {
    Camera camera;
    camera.name = name;
    const std::string key = "K_" + name;
    camera.K = intrinsics(intri_.matrix(key, 9), PixelCentre::integer, intri_.where(key));
    const std::string distortion =
        intri_.has("D_" + name) && !intri_.has("dist_" + name) ? "D_" + name : "dist_" + name;
    set_distortion(camera, Lens::opencv, intri_.matrix(distortion, 0), intri_.where(distortion));
    camera.width = intri_.side("W_" + name);
    camera.height = intri_.side("H_" + name);
    if (extri_ == nullptr) return camera;
    camera.R = read_rotation(name);
    camera.t = Eigen::Map<const Eigen::Vector3d>(extri_->matrix("T_" + name, 3).data());
    return camera;
  }

  Eigen::Matrix3d read_rotation(const std::string& name) const {
    const std::string vector_key = "R_" + name, matrix_key = "Rot_" + name;
    if (!extri_->has(matrix_key)) return from_vector(vector_key);
    const Eigen::Matrix3d matrix = matrix_from_rows(extri_->matrix(matrix_key, 9));
    if (!extri_->has(vector_key)) return repaired_rotation(matrix);
    const Eigen::Matrix3d rotation = from_vector(vector_key);
    if (!((matrix - rotation).cwiseAbs().maxCoeff() <= kEasyMocapSameRotation)) {
      fail_at(extri_->where(vector_key), "reading a camera calibration: {} and {} must be the same rotation",
              vector_key, matrix_key);
    }
    const double error = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    return error <= kEasyMocapAllDigits ? matrix : rotation;
  }

  Eigen::Matrix3d from_vector(const std::string& key) const {
    return rotation_from_vector(Eigen::Map<const Eigen::Vector3d>(extri_->matrix(key, 3).data()));
  }

  void note_differences(const std::vector<std::string>& names, Calibration& calibration) const {
    if (calibration.cameras.empty()) {
      fail_at({extri_->path().string(), 0}, "reading a camera calibration: no camera of {} has a pose in this file",
              intri_.path().filename().string());
    }
    if (const std::size_t without = names.size() - calibration.cameras.size(); without > 0) {
      calibration.notes.emplace_back(fmt::format("{} of {} cameras have no pose in {} and were left out.", without,
                                                 names.size(), extri_->path().filename().string()));
    }
    if (!extri_->has("names")) return;
    const std::set<std::string> known(names.begin(), names.end());
    const std::vector<std::string> posed = extri_->names();
    const auto unknown =
        std::count_if(posed.begin(), posed.end(), [&](const auto& name) { return !known.contains(name); });
    if (unknown > 0) {
      calibration.notes.emplace_back(fmt::format("{} of {} cameras have no intrinsics in {} and were left out.",
                                                 unknown, posed.size(), intri_.path().filename().string()));
    }
  }

  const EasyMocapFile& intri_;
  const EasyMocapFile* extri_;
};

/// The other one of the two files: intri_2.yml belongs to extri_2.yml.
fs::path easymocap_partner(const fs::path& path, const std::string& from, const std::string& to) {
  std::string name = path.filename().string();
  const std::size_t at = name.find(from);
  if (at == std::string::npos) return path.parent_path() / (to + ".yml");
  return path.parent_path() / name.replace(at, from.size(), to);
}

bool easymocap_is_head(std::string_view head) {
  if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
  if (!head.starts_with("%YAML") || head.find("opencv-matrix") == std::string_view::npos) return false;
  const auto has_line = [&](std::string_view begin) { return head.find(fmt::format("\n{}", begin)) != head.npos; };
  return has_line("names:") && (has_line("K_") || has_line("R_") || has_line("Rot_") || has_line("T_"));
}

/// The two files as text. fmt prints the shortest decimals that give the same doubles again.
class EasyMocapWriter {
 public:
  explicit EasyMocapWriter(const std::vector<Camera>& cameras) : cameras_(cameras) {
    std::set<std::string> names;
    for (const Camera& camera : cameras) {
      check(camera);
      if (!names.insert(camera.name).second)
        fail("writing a camera calibration: two cameras have the name \"{}\"", camera.name);
    }
  }

  std::string intri() const {
    std::string text = begin();
    for (const Camera& camera : cameras_) {
      Eigen::Matrix<double, 3, 3, Eigen::RowMajor> K = camera.K;
      K.topRightCorner<2, 1>().array() -= 0.5;
      text += matrix("K_" + camera.name, 3, 3, K.data());
      text += matrix("dist_" + camera.name, 1, kEasyMocapCoefficients, camera.distortion.data());
      if (camera.width > 0 && camera.height > 0)
        text += fmt::format("H_{0}: {1}\nW_{0}: {2}\n", camera.name, camera.height, camera.width);
    }
    return text;
  }

  std::string extri() const {
    std::string text = begin();
    for (const Camera& camera : cameras_) {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R = camera.R;
      const Eigen::Vector3d vector = vector_from_rotation(camera.R);
      text += matrix("R_" + camera.name, 3, 1, vector.data());
      text += matrix("Rot_" + camera.name, 3, 3, R.data());
      text += matrix("T_" + camera.name, 3, 1, camera.t.data());
    }
    return text;
  }

 private:
  static void check(const Camera& camera) {
    const auto surplus = camera.distortion.begin() + kEasyMocapCoefficients;
    if (camera.lens != Lens::opencv || std::any_of(surplus, camera.distortion.end(), [](double k) { return k != 0; })) {
      fail(
          "writing a camera calibration: camera {} has a lens that EasyMocap's files cannot hold; allowed is the "
          "OpenCV "
          "lens with the coefficients k1 k2 p1 p2 k3",
          camera.name);
    }
    constexpr const char* kAllowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    if (camera.name.empty() || camera.name == "none" || camera.name.find_first_not_of(kAllowed) != std::string::npos) {
      fail(
          "writing a camera calibration: the name \"{}\" cannot stand in EasyMocap's files; allowed are letters, "
          "digits, _ and -",
          camera.name);
    }
  }

  std::string begin() const {
    std::string text = "%YAML:1.0\n---\nnames:\n";
    for (const Camera& camera : cameras_) text += fmt::format("  - \"{}\"\n", camera.name);
    return text;
  }

  static std::string matrix(const std::string& key, std::size_t rows, std::size_t cols, const double* values) {
    return fmt::format("{}: !!opencv-matrix\n  rows: {}\n  cols: {}\n  dt: d\n  data: [{}]\n", key, rows, cols,
                       fmt::join(values, values + rows * cols, ", "));
  }

  const std::vector<Camera>& cameras_;
};

/// EasyMocap's intri.yml and extri.yml, as its camera_utils.py reads and writes them (EasyVolcap's too, whose further
/// entries are not needed). The source is one of the files or their folder. The files may name different cameras; those
/// in both are taken. Older files say D_ for dist_.
class EasyMocapCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "easymocap"; }

  bool recognises(const CalibrationSource& source) const override {
    return easymocap_is_head(source.is_folder ? read_head(source.path / "intri.yml", kEasyMocapHeadBytes)
                                              : source.head);
  }

  Calibration read(const CalibrationSource& source) const override {
    const EasyMocapFile first(source.is_folder ? source.path / "intri.yml" : source.path);
    if (!first.has_key_like("K_")) return read_with_intrinsics(first);
    if (first.has_key_like("T_")) return EasyMocapReader(first, &first).read();
    const fs::path partner = easymocap_partner(first.path(), "intri", "extri");
    if (std::error_code ignored; fs::exists(partner, ignored)) {
      const EasyMocapFile extri(partner);
      return EasyMocapReader(first, &extri).read();
    }
    Calibration calibration = EasyMocapReader(first, nullptr).read();
    calibration.notes.emplace_back(
        fmt::format("There is no {} beside the file, so the cameras have no poses.", partner.filename().string()));
    return calibration;
  }

  bool can_write() const override { return true; }
  bool writes_folder() const override { return true; }
  void write(const fs::path& path, const std::vector<Camera>& cameras) const override {
    const EasyMocapWriter writer(cameras);
    write_atomically(path / "intri.yml", writer.intri());
    write_atomically(path / "extri.yml", writer.extri());
  }

 private:
  static Calibration read_with_intrinsics(const EasyMocapFile& extri) {
    const fs::path partner = easymocap_partner(extri.path(), "extri", "intri");
    if (std::error_code ignored; partner == extri.path() || !fs::exists(partner, ignored)) {
      fail_at({extri.path().string(), 0},
              "reading a camera calibration: the file has no intrinsics (K_<name>), and no file {} that has them lies "
              "beside it",
              partner.filename().string());
    }
    const EasyMocapFile intri(partner);
    return EasyMocapReader(intri, &extri).read();
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_easymocap_calibration() { return std::make_unique<EasyMocapCalibration>(); }

}  // namespace doppel
