#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <optional>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

constexpr double kCapturyMetresPerUnit = 0.001;
constexpr std::string_view kCapturyFamily = "tc camera calibration";
constexpr std::string_view kCapturyVersion = "tc camera calibration v0.3";

/// A block of the file. Lengths in millimetres.
struct CapturyBlock {
  int line = 0;
  std::string index, label, serial;
  int frames = 0;
  std::optional<std::array<double, 2>> sensor, centre_offset;
  std::optional<double> focal_length, pixel_aspect;
  std::optional<std::array<double, 3>> origin, up, right;
  std::string lens_model;
  std::vector<double> lens;
};

class CapturyReader {
 public:
  explicit CapturyReader(const std::filesystem::path& path) : reader_(path, "a camera calibration") {}

  Calibration read() {
    calibration_.unit = "mm";
    calibration_.up = "+y";
    read_header();
    while (reader_.next_line()) read_line();
    finish();
    if (calibration_.cameras.empty())
      fail_at({reader_.path().string(), 0}, "reading a camera calibration: the file has no \"camera\"");
    calibration_.notes.emplace_back(
        "the file does not state the size of the images; the intrinsics are in units of their width");
    return std::move(calibration_);
  }

 private:
  void read_header() {
    reader_.require_line("the header");
    const std::string_view line = reader_.line();
    if (line.substr(0, kCapturyFamily.size()) != kCapturyFamily)
      reader_.fail_here("reading a camera calibration: expected the header \"{}\"", kCapturyVersion);
    if (line.substr(0, kCapturyVersion.size()) != kCapturyVersion)
      calibration_.notes.emplace_back(
          fmt::format("the header is \"{}\"; the file was read as v0.3", line.substr(0, 60)));
  }

  /// Keys that are not listed here (tables of colours, the turn for display) mean nothing for the geometry.
  void read_line() {
    const std::string_view key = reader_.tokens()[0];
    if (key == "camera") {
      finish();
      block_.emplace();
      block_->line = reader_.where().line;
      block_->index = word(1);
      block_->label = word(2);
      return;
    }
    if (!block_) return;
    if (key == "serialNumber") block_->serial = word(1);
    if (key == "frame" && ++block_->frames > 1)
      reader_.fail_here("reading a camera calibration: {} moves, only cameras with one \"frame\" can be read", what());
    if (key == "sensorSize") block_->sensor = values<2>();
    if (key == "centerOffset") block_->centre_offset = values<2>();
    if (key == "focalLength") block_->focal_length = values<1>()[0];
    if (key == "pixelAspect") block_->pixel_aspect = values<1>()[0];
    if (key == "origin") block_->origin = values<3>();
    if (key == "up") block_->up = values<3>();
    if (key == "right") block_->right = values<3>();
    if (key == "distortionModel") block_->lens_model = word(1);
    if (key == "distortion") read_lens();
  }

  /// A token of the line; "" at the end of the line and in a comment.
  std::string word(std::size_t token) const {
    const auto& tokens = reader_.tokens();
    const bool there = token < tokens.size() && tokens[token].front() != '#';
    return there ? std::string(tokens[token]) : "";
  }

  template <std::size_t N>
  std::array<double, N> values() const {
    std::array<double, N> found{};
    for (std::size_t i = 0; i < N; ++i) found[i] = reader_.number(i + 1, reader_.tokens()[0]);
    return found;
  }

  void read_lens() {
    block_->lens.clear();
    for (std::size_t i = 1; !word(i).empty(); ++i) block_->lens.push_back(reader_.number(i, "distortion"));
  }

  std::string what() const { return "camera " + (block_->label.empty() ? block_->index : block_->label); }

  template <typename T>
  const T& required(const std::optional<T>& value, const char* key) const {
    if (!value) fail_at(where(), "reading a camera calibration: {} has no \"{}\"", what(), key);
    return *value;
  }

  FileLocation where() const { return {reader_.path().string(), block_->line}; }

  void finish() {
    if (!block_) return;
    Camera camera;
    for (const std::string& name : {block_->label, block_->serial, block_->index})
      if (camera.name.empty()) camera.name = name;
    if (block_->lens_model != "OpenCV")
      fail_at(where(), "reading a camera calibration: {} has the distortionModel \"{}\", only OpenCV can be read",
              what(), block_->lens_model);
    set_distortion(camera, Lens::opencv, block_->lens, where());
    set_intrinsics(camera);
    set_pose(camera);
    calibration_.cameras.push_back(camera);
    block_.reset();
  }

  /// In units of the image's width; the width of the sensor counts for both axes.
  void set_intrinsics(Camera& camera) const {
    const auto& [width, height] = required(block_->sensor, "sensorSize");
    if (!(width > 0.0) || !(height > 0.0))
      fail_at(where(), "reading a camera calibration: {} has the sensorSize {} {}, it must be positive", what(), width,
              height);
    const double focal = required(block_->focal_length, "focalLength") / width;
    const auto& offset = required(block_->centre_offset, "centerOffset");
    camera.K = intrinsics(focal, focal * required(block_->pixel_aspect, "pixelAspect"), 0.5 + offset[0] / width,
                          (0.5 * height + offset[1]) / width, PixelCentre::half);
  }

  void set_pose(Camera& camera) const {
    const Eigen::Vector3d right(required(block_->right, "right").data());
    const Eigen::Vector3d down = -Eigen::Vector3d(required(block_->up, "up").data());
    Eigen::Matrix3d R;
    R << right.transpose(), down.transpose(), right.cross(down).transpose();
    const Eigen::Vector3d origin(required(block_->origin, "origin").data());
    set_pose_at(camera, repaired_rotation(R), kCapturyMetresPerUnit * origin);
  }

  TextReader reader_;
  std::optional<CapturyBlock> block_;
  Calibration calibration_;
};

/// Calibrations of The Captury, which UMA also uses (`.calib`). Semantics: readers that were compared with real files.
///
/// One block per camera: `camera <position> <label>`, then keys with values in millimetres; y of the world is up.
/// R has the rows right, -up, right x (-up), and t = -R origin. With the width W of the image, which the file does not
/// state, and the sensor sw x sh: fx = W f / sw, fy = W f a / sw, cx = W (0.5 + ox / sw), cy = W (sh / 2 + oy) / sw.
/// `orientation` turns the display only.
class CapturyCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "captury"; }

  bool recognises(const CalibrationSource& source) const override {
    const std::size_t begin = source.head.rfind("\xEF\xBB\xBF", 0) == 0 ? 3 : 0;
    return source.head.compare(begin, kCapturyFamily.size(), kCapturyFamily) == 0;
  }

  Calibration read(const CalibrationSource& source) const override { return CapturyReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_captury_calibration() { return std::make_unique<CapturyCalibration>(); }

}  // namespace doppel
