#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/calibration/formats/toml_parts.h"
#include "doppel/core/atomic_file.h"

namespace doppel {

namespace {

constexpr std::uintmax_t kTomlMaxBytes = 16 << 20;
constexpr const char* kTomlCameraKeys[] = {"matrix", "distortions", "rotation", "translation", "size"};
// A square of a calibration board is about 1 to 50 cm wide. Within these bounds the number itself tells its unit.
constexpr double kTomlMinSquare = 0.01, kTomlMaxSquare = 0.5;

/// The position behind the string that begins at `begin`. The end of a string that is not closed does not matter: the
/// parser refuses it.
std::size_t toml_end_of_string(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  const std::string three(3, quote);
  const std::string_view end = text.substr(begin, 3) == three ? std::string_view(three) : text.substr(begin, 1);
  for (std::size_t i = begin + end.size(); i < text.size(); ++i) {
    if (text.substr(i, end.size()) == end) return i + end.size();
    if (quote == '"' && text[i] == '\\') ++i;
  }
  return text.size();
}

/// Whether a key follows the one or two brackets of a table header at `begin`.
bool toml_header_has_key(std::string_view text, std::size_t begin) {
  std::size_t key = text.find_first_not_of(" \t", begin + 1);
  if (key != text.npos && text[key] == '[') key = text.find_first_not_of(" \t", key + 1);
  if (key == text.npos) return false;
  const auto byte = static_cast<unsigned char>(text[key]);
  return byte < 0x80 && (std::isalnum(byte) != 0 || std::string_view("_-\"\']").find(text[key]) != text.npos);
}

/// The position of the first bracket that is not closed by its like, of the first table header without a key, and of
/// the first letter outside of strings that TOML does not allow; otherwise the size of the text. toml++ 3.3 ends the
/// program for some of these when its assertions are on.
std::size_t toml_fault(std::string_view text) {
  std::string open;
  bool at_start = true;  // of a line
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '#' || (c == '[' && open.empty() && at_start)) {
      if (c == '[' && !toml_header_has_key(text, i)) return i;
      i = std::min(text.find('\n', i), text.size());
      continue;
    }
    if (c == '"' || c == '\'') {
      i = toml_end_of_string(text, i);
      at_start = false;
      continue;
    }
    if (static_cast<unsigned char>(c) >= 0x7f || (static_cast<unsigned char>(c) < 0x20 && !std::isspace(c))) return i;
    if (c == '[' || c == '{') open += c;
    if (c == ']' || c == '}') {
      if (open.empty() || open.back() != (c == ']' ? '[' : '{')) return i;
      open.pop_back();
    }
    at_start = c == '\n' || (at_start && (c == ' ' || c == '\t'));
    ++i;
  }
  return text.size();
}

int toml_line(const toml::node& node) { return static_cast<int>(node.source().begin.line); }

void toml_collect(const toml::node& node, const std::string& what, const FileLocation& where,
                  std::vector<double>& found) {
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& item : *list) toml_collect(item, what, where, found);
    return;
  }
  const double value = node.is_number() ? node.value_or(std::nan("")) : std::nan("");
  if (!std::isfinite(value)) fail_at(where, "reading a camera calibration: {} must hold finite numbers", what);
  found.push_back(value);
}

/// The numbers of a list, nested or not. @param table_name for messages; count how many there must be, or 0
std::vector<double> toml_numbers(const toml::table& table, const char* key, std::size_t count,
                                 const std::string& table_name, const FileLocation& where) {
  const toml::node* node = toml_calibration_value(table, key);
  const std::string what = table_name + "." + key;
  if (node == nullptr) fail_at(where, "reading a camera calibration: {} is missing", what);
  const FileLocation here{where.file, toml_line(*node)};
  std::vector<double> found;
  toml_collect(*node, what, here, found);
  if (!node->is_array() || (count != 0 && found.size() != count)) {
    fail_at(here, "reading a camera calibration: {} has {} numbers, expected {}", what, found.size(),
            count ? std::to_string(count) : "a list");
  }
  return found;
}

}  // namespace

toml::table toml_calibration_root(const std::filesystem::path& path) {
  std::string text = read_file(path, kTomlMaxBytes);
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  if (const std::size_t bad = toml_fault(text); bad < text.size()) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(bad), '\n');
    fail_at({path.string(), static_cast<int>(line)},
            "reading a camera calibration: this is no valid TOML: \"{}\" cannot stand here",
            static_cast<unsigned char>(text[bad]) >= 0x7f || text[bad] < ' ' ? '?' : text[bad]);
  }
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& e) {
    fail_at({path.string(), static_cast<int>(e.source().begin.line)},
            "reading a camera calibration: this is no valid TOML: {}", e.description());
  }
}

const toml::node* toml_calibration_value(const toml::table& table, std::string_view key) {
  const toml::node* node = table.get(key);
  return node != nullptr && node->value_or(std::string_view()) == "null" ? nullptr : node;
}

Camera toml_calibration_camera(const toml::table& table, const std::string& name, const FileLocation& where) {
  Camera camera;
  camera.name = name;
  const toml::node* fisheye = toml_calibration_value(table, "fisheye");
  const bool is_fisheye = fisheye != nullptr && fisheye->value_or(false);
  camera.K = intrinsics(toml_numbers(table, "matrix", 9, name, where), PixelCentre::integer, where);
  set_distortion(camera, is_fisheye ? Lens::fisheye : Lens::opencv, toml_numbers(table, "distortions", 0, name, where),
                 where);
  if (toml_calibration_value(table, "size") == nullptr) return camera;
  const std::vector<double> size = toml_numbers(table, "size", 2, name, where);
  camera.width = image_side(size[0], name + ".size", where);
  camera.height = image_side(size[1], name + ".size", where);
  return camera;
}

bool toml_calibration_pose(const toml::table& table, Camera& camera, const FileLocation& where) {
  const auto has = [&](const char* key) { return toml_calibration_value(table, key) != nullptr; };
  if (!has("rotation") && !has("translation")) return false;
  const std::vector<double> rotation = toml_numbers(table, "rotation", 0, camera.name, where),
                            translation = toml_numbers(table, "translation", 3, camera.name, where);
  if (rotation.size() == 9) {
    camera.R = repaired_rotation(matrix_from_rows(rotation));
  } else if (rotation.size() == 3) {
    camera.R = rotation_from_vector(Eigen::Map<const Eigen::Vector3d>(rotation.data()));
  } else {
    fail_at(where, "reading a camera calibration: {}.rotation has {} numbers, expected a vector of 3 or a matrix of 9",
            camera.name, rotation.size());
  }
  camera.t = Eigen::Map<const Eigen::Vector3d>(translation.data());
  return true;
}

namespace {

/// Reads one file; messages name the line, the table and the key.
class TomlReader {
 public:
  explicit TomlReader(const std::filesystem::path& path) : path_(path), root_(toml_calibration_root(path)) {}

  Calibration read() {
    const std::vector<Table> tables = camera_tables();
    if (tables.empty()) {
      fail_at({path_.string(), 0},
              "reading a camera calibration: the file has no table with a camera (matrix, distortions, rotation, "
              "translation)");
    }
    std::vector<Camera> with_pose, all;
    for (const Table& table : tables) {
      const FileLocation where{path_.string(), toml_line(*table.values)};
      Camera camera = toml_calibration_camera(*table.values, table.key, where);
      const bool has_pose = toml_calibration_pose(*table.values, camera, where);
      if (const toml::node* name = table.values->get("name")) camera.name = name->value_or(table.key);
      if (has_pose) with_pose.push_back(camera);
      all.push_back(std::move(camera));
    }
    read_unit();
    keep_cameras(std::move(all), std::move(with_pose));
    return std::move(calibration_);
  }

 private:
  struct Table {
    std::string key;
    const toml::table* values;
  };

  /// The tables with keys of a camera, in the order of the file; toml++ sorts them by name.
  std::vector<Table> camera_tables() const {
    std::vector<Table> tables;
    for (const auto& [key, node] : root_) {
      const toml::table* values = node.as_table();
      if (values == nullptr || key.str() == "metadata") continue;
      const bool is_camera = std::any_of(std::begin(kTomlCameraKeys), std::end(kTomlCameraKeys),
                                         [&](const char* name) { return values->contains(name); });
      if (is_camera) tables.push_back({std::string(key.str()), values});
    }
    std::stable_sort(tables.begin(), tables.end(), [](const Table& a, const Table& b) {
      return a.values->source().begin < b.values->source().begin;
    });
    return tables;
  }

  /// FreeMoCap says the size of the board's squares, in the unit of the translations.
  void read_unit() {
    const double square = root_["metadata"]["charuco_square_size"].value_or(0.0);
    if (square >= kTomlMinSquare && square <= kTomlMaxSquare) calibration_.unit = "m";
    if (square >= 1000 * kTomlMinSquare && square <= 1000 * kTomlMaxSquare) calibration_.unit = "mm";
  }

  void keep_cameras(std::vector<Camera> all, std::vector<Camera> with_pose) {
    const bool all_zero = with_pose.size() > 1 && std::all_of(with_pose.begin(), with_pose.end(), [](const Camera& c) {
                            return c.t.isZero(0) && c.R.isIdentity(0);
                          });
    if (with_pose.empty() || all_zero) {
      calibration_.has_poses = false;
      calibration_.notes.emplace_back(all_zero ? "All rotations and translations are 0, so the cameras have no poses."
                                               : "No camera has rotation and translation, so there are no poses.");
      calibration_.cameras = std::move(all);
      return;
    }
    if (with_pose.size() < all.size()) {
      calibration_.notes.emplace_back(
          fmt::format("{} of {} cameras have no pose and were left out.", all.size() - with_pose.size(), all.size()));
    }
    calibration_.cameras = std::move(with_pose);
    const double metres_per_unit = calibration_.unit == "mm" ? 1e-3 : 1;
    for (Camera& camera : calibration_.cameras) camera.t *= metres_per_unit;
  }

  std::filesystem::path path_;
  toml::table root_;
  Calibration calibration_;
};

/// The shortest decimals that give the same double again. Some readers of TOML refuse lists that mix integers and
/// floats, so whole numbers get a decimal point.
std::string toml_float(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string toml_list(const double* values, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += (i == 0 ? " " : ", ") + toml_float(values[i]);
  return "[" + text + "]";
}

std::string toml_string(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

/// 4 coefficients of a fisheye lens; otherwise the fewest that OpenCV takes and that hold all that are not 0.
std::size_t toml_coefficients(const Camera& camera) {
  if (camera.lens == Lens::fisheye) return 4;
  std::size_t used = camera.distortion.size();
  while (used > 0 && camera.distortion[used - 1] == 0) --used;
  for (const std::size_t count : {4u, 5u, 8u, 12u}) {
    if (used <= count) return count;
  }
  return camera.distortion.size();
}

std::string toml_table(const Camera& camera, std::size_t number, bool with_pose) {
  if (camera.lens == Lens::polynomial) {
    fail("writing a camera calibration: camera {} has a lens of Metashape's kind, which this TOML format cannot hold",
         camera.name);
  }
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> K = camera.K;
  K.topRightCorner<2, 1>().array() -= 0.5;
  std::string text = fmt::format("[cam_{:02}]\nname = {}\n", number, toml_string(camera.name));
  if (camera.width > 0 && camera.height > 0) text += fmt::format("size = [ {}.0, {}.0]\n", camera.width, camera.height);
  text += fmt::format("matrix = [ {}, {}, {}]\n", toml_list(K.data(), 3), toml_list(K.data() + 3, 3),
                      toml_list(K.data() + 6, 3));
  text += fmt::format("distortions = {}\n", toml_list(camera.distortion.data(), toml_coefficients(camera)));
  if (with_pose) {
    const Eigen::Vector3d rotation = vector_from_rotation(camera.R);
    text += fmt::format("rotation = {}\n", toml_list(rotation.data(), 3));
    text += fmt::format("translation = {}\n", toml_list(camera.t.data(), 3));
  }
  return text + fmt::format("fisheye = {}\n\n", camera.lens == Lens::fisheye);
}

/// The TOML files of aniposelib, FreeMoCap and Pose2Sim: one table per camera, of any name, with name, size, matrix,
/// distortions (OpenCV's, or 4 of its fisheye lens), rotation (a vector) and translation. X_cam = R X + t; pixel
/// centres are at integers. The unit is not in the file, but FreeMoCap's metadata has the size of the squares. No axis
/// points up by rule. Pose2Sim writes zeros for poses that it does not know yet. Written files are in metres, as in
/// Pose2Sim.
class TomlCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "toml"; }

  bool recognises(const CalibrationSource& source) const override {
    // Caliscope has tables [cameras.0], in older files [cam_0] with a rotation_count.
    return source.has_line("[") && source.has_line("matrix") && source.has_line("distortions") &&
           !source.has_line("[cameras.") && !source.has_line("rotation_count");
  }

  Calibration read(const CalibrationSource& source) const override { return TomlReader(source.path).read(); }

  bool can_write() const override { return true; }
  bool is_default_for(const std::string& extension) const override { return extension == ".toml"; }
  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    write_tables(path, cameras, true);
  }
  void write_intrinsics(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    write_tables(path, cameras, false);
  }

 private:
  static void write_tables(const std::filesystem::path& path, const std::vector<Camera>& cameras, bool with_poses) {
    std::string text;
    for (std::size_t i = 0; i < cameras.size(); ++i) text += toml_table(cameras[i], i + 1, with_poses);
    write_atomically(path, text + "[metadata]\nadjusted = false\nerror = 0.0\n");
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_toml_calibration() { return std::make_unique<TomlCalibration>(); }

}  // namespace doppel
