#include <Eigen/LU>
#include <algorithm>
#include <charconv>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/camera.h"

namespace doppel {
namespace {

constexpr const char* kHeader = "Skeletool Camera Calibration File V1.0";
constexpr std::string_view kFamily = "Skeletool Camera Calibration";
constexpr const char* kKeys = "name, sensor, size, animated, frame, intrinsic, extrinsic, radial";
// Files have about 6 digits, so R is orthonormal to 1e-5. A larger error up to the second bound is rounding and is
// corrected; beyond that bound the matrix is not a rotation.
constexpr double kOrthonormal = 1e-4, kMendable = 1e-2;

using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// Converts millimetres to metres. The division has more digits than a double, so that values of the writer come back
/// to the last bit.
double metres(const TextReader& reader, std::size_t token, const char* what) {
  reader.number(token, what);
  std::string_view text = reader.tokens()[token];
  if (text[0] == '+') text.remove_prefix(1);
  long double millimetres = 0;
  std::from_chars(text.data(), text.data() + text.size(), millimetres);
  return static_cast<double>(millimetres / 1000.0L);
}

Eigen::Matrix3d mended_rotation(const Eigen::Matrix3d& R, const std::string& camera, const FileLocation& where) {
  const double deviation = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (deviation <= kOrthonormal || !(deviation <= kMendable)) return R;
  log::warn("{}: camera {}: R R^T is off the identity by {:.2g}; using the nearest rotation", where.to_string(), camera,
            deviation);
  return repaired_rotation(R);
}

class SkeletoolReader {
 public:
  explicit SkeletoolReader(const std::filesystem::path& path) : reader_(path, "a camera calibration") {}

  std::vector<Camera> read() {
    reader_.require_line("the header");
    if (reader_.line() != kHeader)
      reader_.fail_here("reading a camera calibration: expected the header \"{}\"", kHeader);
    while (reader_.next_line()) read_line();
    finish_camera();
    return std::move(cameras_);
  }

 private:
  void read_line() {
    const std::string_view key = reader_.tokens()[0];
    if (key == "name") return begin_camera();
    if (camera_.name.empty())
      reader_.fail_here("reading a camera calibration: expected \"name\", found \"{}\"", key.substr(0, 40));
    if (key == "sensor") return expect_tokens(3);
    if (key == "size") return read_size();
    if (key == "animated") return read_animated();
    if (key == "frame") return begin_frame();
    if (key == "intrinsic") return read_intrinsic();
    if (key == "extrinsic") return read_extrinsic();
    if (key == "radial") return read_radial();
    reader_.fail_here(
        "reading a camera calibration: found \"{}\", which Doppel cannot read (fisheye lenses are not supported); "
        "known are {}",
        key.substr(0, 40), kKeys);
  }

  void expect_tokens(std::size_t n) const {
    for (std::size_t i = 1; i < n; ++i) reader_.number(i, reader_.tokens()[0]);
    if (reader_.tokens().size() > n) {
      reader_.fail_here("reading a camera calibration: \"{}\" takes {} numbers, found {}", reader_.tokens()[0], n - 1,
                        reader_.tokens().size() - 1);
    }
  }

  void begin_camera() {
    finish_camera();
    if (reader_.tokens().size() != 2) reader_.fail_here("reading a camera calibration: \"name\" takes one word");
    camera_ = Camera{};
    camera_.name = std::string(reader_.tokens()[1]);
    where_ = reader_.where();
    has_size_ = animated_ = in_frame_ = had_frames_ = has_intrinsic_ = has_extrinsic_ = false;
  }

  void read_size() {
    expect_tokens(3);
    camera_.width = static_cast<int>(reader_.integer(1, "the image width", 1, kMaxImageSide));
    camera_.height = static_cast<int>(reader_.integer(2, "the image height", 1, kMaxImageSide));
    has_size_ = true;
  }

  void read_animated() {
    expect_tokens(2);
    animated_ = reader_.integer(1, "animated", 0, 1) == 1;
  }

  void begin_frame() {
    if (!animated_) reader_.fail_here("reading a camera calibration: found \"frame\" in a camera with \"animated 0\"");
    expect_tokens(2);
    finish_pose();
    frame_ = reader_.integer(1, "the frame number", 0, 1L << 40);
    in_frame_ = had_frames_ = true;
    has_intrinsic_ = has_extrinsic_ = false;
    where_ = reader_.where();
  }

  Matrix4 read_matrix(bool& seen) {
    if (seen)
      reader_.fail_here("reading a camera calibration: a second \"{}\" for camera {}", reader_.tokens()[0],
                        camera_.name);
    expect_tokens(17);
    Matrix4 matrix;
    for (std::size_t i = 0; i < 16; ++i) matrix.data()[i] = reader_.number(i + 1, reader_.tokens()[0]);
    if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      reader_.fail_here("reading a camera calibration: the last row of \"{}\" must be 0 0 0 1", reader_.tokens()[0]);
    }
    seen = true;
    return matrix;
  }

  void read_intrinsic() {
    const Matrix4 matrix = read_matrix(has_intrinsic_);
    if (!matrix.topRightCorner<3, 1>().isZero(0)) {
      reader_.fail_here("reading a camera calibration: the last column of \"intrinsic\" must be 0 0 0 1");
    }
    camera_.K = matrix.topLeftCorner<3, 3>();
  }

  void read_extrinsic() {
    const Matrix4 matrix = read_matrix(has_extrinsic_);
    camera_.R = mended_rotation(matrix.topLeftCorner<3, 3>(), camera_.name, reader_.where());
    for (int row = 0; row < 3; ++row) camera_.t[row] = metres(reader_, as_size(4 * row + 4), "extrinsic");
  }

  void read_radial() {
    for (std::size_t i = 1; i < std::max<std::size_t>(2, reader_.tokens().size()); ++i) {
      if (reader_.number(i, "radial") == 0) continue;
      reader_.fail_here(
          "reading a camera calibration: camera {} has radial distortion {}, which this format does not define; "
          "undistort the images and write 0, or give an OpenCV calibration",
          camera_.name, reader_.tokens()[i]);
    }
  }

  /// Stores the pose read so far, at the end of a static camera or of a frame.
  void finish_pose() {
    if (animated_ && !in_frame_) return;
    const char* missing = !has_size_ ? "size" : !has_intrinsic_ ? "intrinsic" : !has_extrinsic_ ? "extrinsic" : nullptr;
    if (missing)
      fail_at(where_, "reading a camera calibration: camera {} has no \"{}\"; is the file truncated?", camera_.name,
              missing);
    cameras_.push_back(camera_);
    if (in_frame_) cameras_.back().name += "@" + std::to_string(frame_);
    const std::vector<std::string> faults = camera_.faults();
    if (!faults.empty()) fail_at(where_, "reading a camera calibration: {}", faults.front());
  }

  void finish_camera() {
    if (camera_.name.empty()) return;
    if (animated_ && !had_frames_) {
      fail_at(where_, "reading a camera calibration: camera {} is animated but has no \"frame\"", camera_.name);
    }
    finish_pose();
  }

  TextReader reader_;
  std::vector<Camera> cameras_;
  Camera camera_;
  FileLocation where_;
  long frame_ = 0;
  bool has_size_ = false, animated_ = false, in_frame_ = false, had_frames_ = false;
  bool has_intrinsic_ = false, has_extrinsic_ = false;
};

/// `cam@12` -> {cam, 12}; a camera that does not move has an empty frame.
std::pair<std::string, std::string> split_frame(const std::string& name) {
  const std::size_t at = name.rfind('@');
  if (at == std::string::npos || at == 0 || at + 1 == name.size() || name.size() - at > 12 ||
      name.find_first_not_of("0123456789", at + 1) != std::string::npos) {
    return {name, ""};
  }
  return {name.substr(0, at), name.substr(at + 1)};
}

std::string pose_text(const Camera& camera) {
  std::string text = "  intrinsic  ";
  for (int row = 0; row < 3; ++row)
    text += fmt::format(" {} {} {} 0", camera.K(row, 0), camera.K(row, 1), camera.K(row, 2));
  text += " 0 0 0 1\n  extrinsic  ";
  for (int row = 0; row < 3; ++row) {
    text += fmt::format(" {} {} {} {}", camera.R(row, 0), camera.R(row, 1), camera.R(row, 2),
                        static_cast<long double>(camera.t[row]) * 1000.0L);
  }
  return text + " 0 0 0 1\n  radial      0\n";
}

/// `.calibration` V1.0 of Skeletool: intrinsics and extrinsics as 4 x 4 matrices, millimetres, y up, without
/// distortion. A moving camera (`animated 1`) yields one Camera per frame, named `<name>@<frame>`.
class SkeletoolCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "skeletool"; }
  bool recognises(const CalibrationSource& source) const override {
    // Compares the first words only: the reader reports another version of the format.
    const std::string& head = source.head;
    const std::size_t begin = head.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
    const std::size_t text = head.find_first_not_of(" \t\r\n", begin);
    return text != std::string::npos && head.compare(text, kFamily.size(), kFamily) == 0;
  }
  bool can_write() const override { return true; }
  bool holds_distortion() const override { return false; }
  bool is_default_for(const std::string& extension) const override { return extension == ".calibration"; }
  Calibration read(const CalibrationSource& source) const override {
    Calibration calibration;
    calibration.unit = "mm";
    calibration.up = "+y";
    calibration.cameras = SkeletoolReader(source.path).read();
    return calibration;
  }

  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    std::string text = std::string(kHeader) + "\n", open;
    for (const Camera& camera : cameras) {
      const auto [name, frame] = split_frame(camera.name);
      if (name.empty() || name.find_first_of(" \t\r\n") != std::string::npos) {
        fail("writing a camera calibration: the name \"{}\" must be one word in this format", name);
      }
      if (camera.has_distortion()) {
        fail(
            "writing a camera calibration: camera {} has lens distortion, which .calibration files cannot hold; write "
            ".yml",
            camera.name);
      }
      const std::string head =
          fmt::format("name          {}\n  sensor      1 1\n  size        {} {}\n  animated    {}\n", name,
                      camera.width, camera.height, frame.empty() ? 0 : 1);
      if (frame.empty() || head != open) text += head;
      open = frame.empty() ? "" : head;
      if (!frame.empty()) text += "  frame       " + frame + "\n";
      text += pose_text(camera);
    }
    write_atomically(path, text);
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_skeletool_calibration() { return std::make_unique<SkeletoolCalibration>(); }

}  // namespace doppel
