#include <algorithm>
#include <string_view>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/calibration/formats/toml_parts.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

/// Reads one camera_array.toml, or the config.toml of older versions; messages name the line, the camera and the key.
class CaliscopeReader {
 public:
  explicit CaliscopeReader(const fs::path& path) : path_(path), root_(toml_calibration_root(path)) {}

  Calibration read() {
    const std::vector<Item> items = find_cameras();
    if (items.empty()) refuse("the file has no camera; expected tables [cameras.0] or [cam_0]");
    for (const Item& item : items) read_item(item);
    if (with_pose_.empty() && without_pose_.empty()) refuse("no camera of the file has intrinsics");
    if (is_metric()) calibration_.unit = "m";
    calibration_.has_poses = !with_pose_.empty();
    note_left_out(calibration_.has_poses ? without_pose_.size() : 0, items.size(), "have no pose");
    note_left_out(ignored_, items.size(), "are marked \"ignore\"");
    note_left_out(without_intrinsics_, items.size(), "have no intrinsics");
    calibration_.cameras = std::move(calibration_.has_poses ? with_pose_ : without_pose_);
    return std::move(calibration_);
  }

 private:
  struct Item {
    std::string key;
    const toml::table* values;
  };

  /// The tables of the cameras in the order of the file; toml++ sorts them by name.
  std::vector<Item> find_cameras() const {
    std::vector<Item> items;
    const toml::table* cameras = root_["cameras"].as_table();
    const std::string_view begin = cameras != nullptr ? "" : "cam_";
    for (const auto& [key, node] : cameras != nullptr ? *cameras : root_) {
      const toml::table* values = node.as_table();
      if (values != nullptr && key.str().starts_with(begin)) items.push_back({std::string(key.str()), values});
    }
    std::stable_sort(items.begin(), items.end(),
                     [](const Item& a, const Item& b) { return a.values->source().begin < b.values->source().begin; });
    return items;
  }

  void read_item(const Item& item) {
    const toml::node* ignore = toml_calibration_value(*item.values, "ignore");
    if (ignore != nullptr && ignore->value_or(false)) {
      ++ignored_;
    } else if (toml_calibration_value(*item.values, "matrix") == nullptr) {
      ++without_intrinsics_;
    } else {
      const FileLocation where{path_.string(), static_cast<int>(item.values->source().begin.line)};
      Camera camera = toml_calibration_camera(*item.values, name_of(item), where);
      const bool has_pose = toml_calibration_pose(*item.values, camera, where);
      (has_pose ? with_pose_ : without_pose_).push_back(std::move(camera));
    }
  }

  static std::string name_of(const Item& item) {
    for (const char* key : {"cam_id", "port"}) {
      const toml::node* id = item.values->get(key);
      if (id != nullptr && id->is_integer()) return std::to_string(id->value_or(std::int64_t{0}));
    }
    return item.key;
  }

  /// Whether a board gave the scale. Caliscope turns the size of its squares, whatever their unit, into metres; without
  /// a board the scale is free.
  bool is_metric() const {
    if (const toml::table* board = root_["charuco"].as_table()) return has_size(*board);
    const fs::path path = path_.parent_path() / "charuco.toml";
    std::error_code ignored;
    return fs::exists(path, ignored) && has_size(toml_calibration_root(path));
  }

  static bool has_size(const toml::table& board) {
    const auto is_length = [&](const char* key) { return board[key].value_or(0.0) > 0; };
    return is_length("square_size_override_cm") || is_length("square_size_overide_cm") ||
           (is_length("board_height") && is_length("board_width"));
  }

  void note_left_out(std::size_t count, std::size_t all, const char* why) {
    if (count > 0)
      calibration_.notes.emplace_back(fmt::format("{} of {} cameras {} and were left out.", count, all, why));
  }

  [[noreturn]] void refuse(const char* fault) const {
    fail_at({path_.string(), 0}, "reading a camera calibration: {}", fault);
  }

  fs::path path_;
  toml::table root_;
  std::vector<Camera> with_pose_, without_pose_;
  std::size_t ignored_ = 0, without_intrinsics_ = 0;
  Calibration calibration_;
};

/// Caliscope's camera_array.toml: tables [cameras.N] (in the config.toml of older versions [cam_N]) with cam_id or
/// port, size, matrix, distortions (OpenCV's, or 4 of its fisheye lens), rotation (a matrix, or a vector) and
/// translation. X_cam = R X + t; pixel centres are at integers. Metres if a charuco board gave the scale: charuco.toml
/// lies beside the file then. rotation_count turns only the display. The user may have set the origin, so no axis
/// points up by rule.
class CaliscopeCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "caliscope"; }

  bool recognises(const CalibrationSource& source) const override {
    return source.has_line("size") &&
           (source.has_line("[cameras.") || (source.has_line("[cam_") && source.has_line("rotation_count")));
  }

  Calibration read(const CalibrationSource& source) const override { return CaliscopeReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_caliscope_calibration() { return std::make_unique<CaliscopeCalibration>(); }

}  // namespace doppel
