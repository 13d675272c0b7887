#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/load_yaml.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kRosMaxBytes = 64 << 20;  // of minutes of messages
constexpr double kRosMaxBinning = 1024;

/// One YAML document of a file.
struct RosDocument {
  std::string text;
  int lines_before = 0;
  bool is_closed = false;  ///< whether "---" follows

  /// Where a message goes on behind its header, which has the time; npos in other files.
  std::size_t end_of_header() const { return text.find("\nheight:"); }
  /// What does not change from message to message.
  std::string_view body() const {
    const std::size_t begin = end_of_header();
    return std::string_view(text).substr(begin == std::string::npos ? 0 : begin);
  }
  /// Whether this is the beginning of a message like another one, as the last one of a recording may be.
  bool is_cut_off_from(const RosDocument& whole) const {
    if (is_closed || !whole.is_closed || whole.end_of_header() == std::string::npos) return false;
    const std::string_view found = body();
    return end_of_header() == std::string::npos || whole.body().starts_with(found.substr(0, found.rfind('\n')));
  }
};

/// The documents between lines of "---" that hold more than comments and directives.
std::vector<RosDocument> ros_documents(const std::string& text) {
  std::vector<RosDocument> documents;
  RosDocument document;
  bool has_content = false;
  int line = 0;
  const auto close = [&](bool is_closed) {
    document.is_closed = is_closed;
    if (has_content) documents.push_back(std::move(document));
    document = {"", line, false};
    has_content = false;
  };
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view row = std::string_view(text).substr(at, end - at);
    const std::size_t begin = row.find_first_not_of(" \t\r\xEF\xBB\xBF");
    ++line;
    at = end + 1;
    if (begin == 0 && row.starts_with("---") && row.find_first_not_of(" \t\r", 3) == row.npos) {
      close(true);
      continue;
    }
    has_content |= begin != row.npos && row[begin] != '#' && row[begin] != '%';
    document.text.append(row.starts_with('%') ? std::string_view() : row).append("\n");
  }
  close(false);
  return documents;
}

/// Reads one camera_info file; messages name the line and the key.
class RosReader {
 public:
  explicit RosReader(const std::filesystem::path& path) : path_(path) {}

  Calibration read() {
    const std::vector<RosDocument> documents = ros_documents(read_file(path_, kRosMaxBytes));
    if (documents.empty()) fail_at({path_.string(), 0}, "reading a camera calibration: the file is empty");
    Calibration calibration;
    calibration.has_poses = false;
    calibration.cameras.push_back(read_document(documents[0]));
    for (const RosDocument& document : documents) check_same(documents[0], document, calibration.cameras[0]);
    return calibration;
  }

 private:
  /// A file has one camera. The same camera may have sent many messages, of which the last may be cut off.
  void check_same(const RosDocument& first, const RosDocument& other, const Camera& camera) {
    if (other.body() == first.body() || other.is_cut_off_from(first)) return;
    const Camera found = read_document(other);
    if (found.K != camera.K || found.width != camera.width || found.height != camera.height ||
        found.lens != camera.lens || found.distortion != camera.distortion)
      fail_at(
          {path_.string(), other.lines_before + 1},
          "reading a camera calibration: this message is of another camera than the first one of the file; keep one "
          "message of each camera, in a file of its own");
  }

  Camera read_document(const RosDocument& document) {
    lines_before_ = document.lines_before;
    try {
      return read_camera(load_yaml(document.text));
    } catch (const YAML::Exception& e) {
      fail_at({path_.string(), lines_before_ + e.mark.line + 1},
              "reading a camera calibration: this is no valid YAML: {}", e.msg);
    }
  }

  Camera read_camera(const YAML::Node& root) const {
    if (!root.IsMap()) refuse(root, "expected the keys of a camera_info file");
    Camera camera;
    const YAML::Node name = root["camera_name"];
    camera.name = name && name.IsScalar() && !name.Scalar().empty() ? name.Scalar() : path_.stem().string();
    camera.width = side(root, {"image_width", "width"});
    camera.height = side(root, {"image_height", "height"});
    const YAML::Node K = data_of(root, {"camera_matrix", "K", "k"});
    camera.K = intrinsics(numbers(K, "camera_matrix"), PixelCentre::integer, where(K));
    const YAML::Node distortion = data_of(root, {"distortion_coefficients", "D", "d"});
    const std::vector<double> coefficients = numbers(distortion, "distortion_coefficients");
    set_distortion(camera, lens(root, coefficients), coefficients, where(distortion));
    crop(root, camera);
    return camera;
  }

  /// The images of a message are the region of interest, binned: K and the size are those of the whole sensor.
  void crop(const YAML::Node& root, Camera& camera) const {
    const YAML::Node roi = root["roi"];
    const auto of_roi = [&](const char* key) { return roi && roi.IsMap() && roi[key] ? number(roi[key], key) : 0.0; };
    const auto binning = [&](const char* key) { return root[key] ? std::max(1.0, number(root[key], key)) : 1.0; };
    const double x = of_roi("x_offset"), y = of_roi("y_offset"), bin_x = binning("binning_x"),
                 bin_y = binning("binning_y"), width = of_roi("width"), height = of_roi("height");
    if (bin_x > kRosMaxBinning || bin_y > kRosMaxBinning || x < 0 || y < 0 || width < 0 || height < 0 ||
        x + width > camera.width || y + height > camera.height)
      refuse(root, "the region of interest (roi, binning_x, binning_y) does not lie in the image");
    if (width > 0 && height > 0) {
      camera.width = static_cast<int>(width);
      camera.height = static_cast<int>(height);
      camera.K(0, 2) -= x;
      camera.K(1, 2) -= y;
    }
    camera.K.row(0) /= bin_x;
    camera.K.row(1) /= bin_y;
    camera.width = std::max(1, static_cast<int>(camera.width / bin_x));
    camera.height = std::max(1, static_cast<int>(camera.height / bin_y));
  }

  Lens lens(const YAML::Node& root, const std::vector<double>& coefficients) const {
    const YAML::Node node = required(root, {"distortion_model"});
    const std::string model = node.IsScalar() ? node.Scalar() : "";
    if (model == "plumb_bob" || model == "rational_polynomial") return Lens::opencv;
    if (model == "equidistant" || model == "fisheye") return Lens::fisheye;
    if ((model.empty() || model == "none" || model == "None") &&
        std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0; }))
      return Lens::opencv;
    refuse(node, fmt::format("distortion_model is \"{}\", allowed are plumb_bob, rational_polynomial and equidistant",
                             excerpt(model, 40)));
  }

  YAML::Node data_of(const YAML::Node& root, std::initializer_list<const char*> keys) const {
    const YAML::Node node = required(root, keys);
    const YAML::Node data = node.IsMap() ? node["data"] : node;
    if (!data || !data.IsSequence()) refuse(node, fmt::format("{} must have a list \"data\"", *keys.begin()));
    return data;
  }

  std::vector<double> numbers(const YAML::Node& list, const char* key) const {
    std::vector<double> found;
    for (const YAML::Node& item : list) found.push_back(number(item, key));
    return found;
  }

  double number(const YAML::Node& node, const char* key) const {
    const std::optional<double> value = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (!value || !std::isfinite(*value)) refuse(node, fmt::format("{} must hold finite numbers", key));
    return *value;
  }

  int side(const YAML::Node& root, std::initializer_list<const char*> keys) const {
    const YAML::Node node = required(root, keys);
    return image_side(number(node, *keys.begin()), *keys.begin(), where(node));
  }

  /// @param keys the spellings of one key
  YAML::Node required(const YAML::Node& root, std::initializer_list<const char*> keys) const {
    for (const char* key : keys)
      if (const YAML::Node node = root[key]) return node;
    refuse(root, fmt::format("{} is missing", fmt::join(keys, " or ")));
  }

  FileLocation where(const YAML::Node& node) const { return {path_.string(), lines_before_ + node.Mark().line + 1}; }
  [[noreturn]] void refuse(const YAML::Node& node, const std::string& fault) const {
    fail_at(where(node), "reading a camera calibration: {}", fault);
  }

  std::filesystem::path path_;
  int lines_before_ = 0;  ///< the document that is read
};

/// The camera_info YAML of ROS's camera_calibration and camera_info_manager, or the messages sensor_msgs/CameraInfo as
/// rostopic (D, K) and ros2 topic (d, k) print them: the intrinsics of one camera.
/// distortion_model plumb_bob (k1 k2 p1 p2 k3) and rational_polynomial (and k4 k5 k6) are OpenCV's lens, equidistant is
/// its fisheye lens; pixel centres are at integers. projection_matrix (P) belongs to rectified images and is not read.
class RosCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "ros_camera_info"; }

  bool recognises(const CalibrationSource& source) const override {
    // OpenCV's calibration files have keys of the same names, but tag their matrices.
    const bool has_matrix = source.has_line("camera_matrix:") || source.has_line("K:") || source.has_line("k:");
    return has_matrix && source.has_line("distortion_model:") && !source.has("opencv-matrix");
  }

  Calibration read(const CalibrationSource& source) const override { return RosReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_ros_calibration() { return std::make_unique<RosCalibration>(); }

}  // namespace doppel
