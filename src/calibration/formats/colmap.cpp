#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/file_head.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/camera.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kColmapMaxBytes = std::uintmax_t{1} << 30;
constexpr std::size_t kColmapHeadBytes = 16 << 10;
constexpr std::int32_t kColmapMaxModel = 64;  // ids beyond are no COLMAP file; 17 is the last one in use
constexpr std::size_t kFisheyeCoefficients = 4;
constexpr double kColmapSamePose = 1e-6;
// The smallest records of the binary files, for the check of their counts.
constexpr std::size_t kColmapCameraBytes = 4 + 4 + 8 + 8, kColmapImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr std::size_t kColmapPointBytes = 8 + 8 + 8;
constexpr const char* kColmapReadable =
    "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV, SIMPLE_RADIAL_FISHEYE and "
    "RADIAL_FISHEYE";

/// A lens model: its parameters are `focal_lengths` focal lengths, cx, cy and the coefficients in the order of `lens`.
struct ColmapModel {
  const char* name;
  std::size_t parameters;
  std::size_t focal_lengths = 0;  ///< 0: a model that this reader refuses
  Lens lens = Lens::opencv;
};

/// The models in the order of their numbers in binary files.
constexpr ColmapModel kColmapModels[] = {{"SIMPLE_PINHOLE", 3, 1},
                                         {"PINHOLE", 4, 2},
                                         {"SIMPLE_RADIAL", 4, 1},
                                         {"RADIAL", 5, 1},
                                         {"OPENCV", 8, 2},
                                         {"OPENCV_FISHEYE", 8, 2, Lens::fisheye},
                                         {"FULL_OPENCV", 12, 2},
                                         {"FOV", 5},
                                         {"SIMPLE_RADIAL_FISHEYE", 4, 1, Lens::fisheye},
                                         {"RADIAL_FISHEYE", 5, 1, Lens::fisheye},
                                         {"THIN_PRISM_FISHEYE", 12},
                                         {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                         {"SIMPLE_DIVISION", 4},
                                         {"DIVISION", 5},
                                         {"SIMPLE_FISHEYE", 3},
                                         {"FISHEYE", 4},
                                         {"EUCM", 6},
                                         {"EQUIRECTANGULAR", 2}};

struct ColmapCamera {
  std::string model;
  std::uint64_t width = 0, height = 0;
  std::vector<double> parameters;
  FileLocation where;
};

struct ColmapImage {
  std::string name;
  std::int64_t camera = 0;
  double pose[7] = {};  ///< qw qx qy qz tx ty tz, camera from world
  FileLocation where;
};

struct ColmapContent {
  std::map<std::int64_t, ColmapCamera> cameras;
  std::vector<ColmapImage> images;
};

const ColmapModel* colmap_model(const std::string& name) {
  for (const ColmapModel& model : kColmapModels) {
    if (name == model.name) return &model;
  }
  return nullptr;
}

bool is_colmap_side(std::uint64_t side) { return side >= 1 && side <= std::uint64_t{kMaxImageSide}; }

std::vector<std::string_view> colmap_tokens(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r";
  std::vector<std::string_view> tokens;
  for (std::size_t begin = line.find_first_not_of(kBlanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    tokens.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
  return tokens;
}

/// A token as an integer that is not negative.
std::optional<std::int64_t> colmap_integer(std::string_view token) {
  std::int64_t value = 0;
  const auto [rest, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || rest != token.data() + token.size() || value < 0) return std::nullopt;
  return value;
}

/// The lines of a text file, with the empty ones: in images.txt they have a meaning.
class ColmapLines {
 public:
  explicit ColmapLines(std::string_view text) : text_(text) {
    if (text_.substr(0, 3) == "\xEF\xBB\xBF") text_.remove_prefix(3);
  }

  bool next() {
    if (position_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', position_), text_.size());
    line_ = text_.substr(position_, end - position_);
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ' || line_.back() == '\t'))
      line_.remove_suffix(1);
    position_ = end + 1;
    ++number_;
    return true;
  }
  /// Moves to the next line that is neither empty nor a comment.
  bool next_record() {
    while (next()) {
      const std::size_t begin = line_.find_first_not_of(" \t");
      if (begin != std::string_view::npos && line_[begin] != '#') return true;
    }
    return false;
  }
  std::string_view line() const { return line_; }
  int number() const { return number_; }

 private:
  std::string_view text_, line_;
  std::size_t position_ = 0;
  int number_ = 0;
};

class ColmapTextReader {
 public:
  ColmapContent read(const std::filesystem::path& cameras, const std::filesystem::path& images) {
    read_cameras(cameras);
    read_images(images);
    return std::move(content_);
  }

 private:
  std::string open(const std::filesystem::path& path) {
    where_ = {path.string(), 0};
    std::string text = read_file(path, kColmapMaxBytes);
    if (text.find('\0') != std::string::npos)
      fail_at(where_, "reading a camera calibration: this is not a text file (found a NUL byte)");
    return text;
  }

  double number(std::string_view token, const char* what) const {
    const auto value = parse_number(token);
    if (!value || !std::isfinite(*value))
      fail_at(where_, "reading a camera calibration: {} must be a finite number, found \"{}\"", what, excerpt(token));
    return *value;
  }

  std::int64_t integer(std::string_view token, const char* what) const {
    const auto value = colmap_integer(token);
    if (!value)
      fail_at(where_, "reading a camera calibration: {} must be an integer, found \"{}\"", what, excerpt(token));
    return *value;
  }

  void read_cameras(const std::filesystem::path& path) {
    const std::string text = open(path);
    ColmapLines lines(text);
    while (lines.next_record()) {
      where_.line = lines.number();
      const auto tokens = colmap_tokens(lines.line());
      if (tokens.size() < 5)
        fail_at(where_,
                "reading a camera calibration: a camera has the number, the model, the width, the height and the "
                "parameters, found {} items",
                tokens.size());
      ColmapCamera camera;
      camera.where = where_;
      camera.model = tokens[1];
      camera.width = static_cast<std::uint64_t>(integer(tokens[2], "the width"));
      camera.height = static_cast<std::uint64_t>(integer(tokens[3], "the height"));
      for (std::size_t i = 4; i < tokens.size(); ++i)
        camera.parameters.push_back(number(tokens[i], "a parameter of the lens"));
      const std::int64_t id = integer(tokens[0], "the number of a camera");
      if (!content_.cameras.emplace(id, camera).second)
        fail_at(where_, "reading a camera calibration: a second camera has the number {}", id);
    }
  }

  void read_images(const std::filesystem::path& path) {
    const std::string text = open(path);
    ColmapLines lines(text);
    while (lines.next_record()) {
      where_.line = lines.number();
      content_.images.push_back(read_image(lines.line()));
      if (!lines.next()) break;
      where_.line = lines.number();
      check_points(lines.line());
    }
  }

  ColmapImage read_image(std::string_view line) const {
    const auto tokens = colmap_tokens(line);
    if (tokens.size() < 10)
      fail_at(where_,
              "reading a camera calibration: an image has its number, qw qx qy qz tx ty tz, the number of its camera "
              "and its name, found {} items",
              tokens.size());
    ColmapImage image;
    image.where = where_;
    integer(tokens[0], "the number of an image");
    for (std::size_t i = 0; i < 7; ++i) image.pose[i] = number(tokens[i + 1], "the pose of an image");
    image.camera = integer(tokens[8], "the number of a camera");
    image.name = line.substr(as_size(tokens[9].data() - line.data()));  // to the end: names may hold blanks
    return image;
  }

  /// The second line of an image. A file without these lines would lose every second image.
  void check_points(std::string_view line) const {
    const auto tokens = colmap_tokens(line);
    if (tokens.size() % 3 != 0 || (!tokens.empty() && !parse_number(tokens.back())))
      fail_at(where_,
              "reading a camera calibration: the second line of an image must hold its points (x y number), or be "
              "empty");
  }

  ColmapContent content_;
  FileLocation where_;
};

class ColmapBinaryReader {
 public:
  ColmapContent read(const std::filesystem::path& cameras, const std::filesystem::path& images) {
    open(cameras);
    for (std::uint64_t left = take_count(kColmapCameraBytes, "cameras"); left > 0; --left) read_camera();
    close();
    open(images);
    for (std::uint64_t left = take_count(kColmapImageBytes, "images"); left > 0; --left) read_image();
    close();
    return std::move(content_);
  }

 private:
  void open(const std::filesystem::path& path) {
    where_ = {path.string(), 0};
    bytes_ = read_file(path, kColmapMaxBytes);
    position_ = 0;
  }

  void close() const {
    if (position_ != bytes_.size())
      fail_at(where_, "reading a camera calibration: {} bytes follow the last record; is a count wrong?",
              bytes_.size() - position_);
  }

  void require(std::size_t size) const {
    if (size > bytes_.size() - position_)
      fail_at(where_, "reading a camera calibration: the file ends inside a record at byte {}; is it truncated?",
              position_);
  }

  template <typename Number>
  Number take() {
    require(sizeof(Number));
    Number value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(Number));
    position_ += sizeof(Number);
    return value;
  }

  double take_finite(const char* what) {
    const auto value = take<double>();
    if (!std::isfinite(value))
      fail_at(where_, "reading a camera calibration: {} at byte {} must be finite", what, position_ - sizeof(double));
    return value;
  }

  /// A count of records, which must fit into the rest of the file.
  std::uint64_t take_count(std::size_t record_bytes, const char* what) {
    const auto count = take<std::uint64_t>();
    const std::size_t left = bytes_.size() - position_;
    if (count > left / record_bytes)
      fail_at(where_, "reading a camera calibration: the file states {} {}, but only {} bytes follow at byte {}", count,
              what, left, position_);
    return count;
  }

  void read_camera() {
    ColmapCamera camera;
    camera.where = where_;
    const std::int64_t id = take<std::uint32_t>();
    const auto model = take<std::int32_t>();
    if (model < 0 || as_size(model) >= std::size(kColmapModels))
      fail_at(where_, "reading a camera calibration: camera {} has the lens model number {}; supported are {}", id,
              model, kColmapReadable);
    camera.model = kColmapModels[model].name;
    camera.width = take<std::uint64_t>();
    camera.height = take<std::uint64_t>();
    for (std::size_t i = 0; i < kColmapModels[model].parameters; ++i)
      camera.parameters.push_back(take_finite("a parameter of a lens"));
    if (!content_.cameras.emplace(id, camera).second)
      fail_at(where_, "reading a camera calibration: a second camera has the number {}", id);
  }

  void read_image() {
    ColmapImage image;
    image.where = where_;
    take<std::uint32_t>();  // the number of the image
    for (double& value : image.pose) value = take_finite("the pose of an image");
    image.camera = take<std::uint32_t>();
    const std::size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos)
      fail_at(where_, "reading a camera calibration: the name of an image at byte {} has no end; is it truncated?",
              position_);
    if (end == position_)
      fail_at(where_, "reading a camera calibration: the image at byte {} has an empty name", position_);
    image.name = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    const std::uint64_t points = take_count(kColmapPointBytes, "points of an image");
    position_ += as_size(points) * kColmapPointBytes;
    content_.images.push_back(std::move(image));
  }

  ColmapContent content_;
  FileLocation where_;
  std::string bytes_;
  std::size_t position_ = 0;
};

/// The files of a model. A folder may hold both kinds; the text one is often rounded.
struct ColmapFiles {
  std::filesystem::path cameras, images;
  bool is_binary = false;
};

bool is_colmap_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

ColmapFiles colmap_files(const CalibrationSource& source) {
  const std::filesystem::path folder = source.is_folder ? source.path : source.path.parent_path();
  const auto files = [&](const std::string& extension) {
    return ColmapFiles{folder / ("cameras" + extension), folder / ("images" + extension), extension == ".bin"};
  };
  if (!source.is_folder) return files(source.path.extension() == ".bin" ? ".bin" : ".txt");
  const ColmapFiles binary = files(".bin");
  return is_colmap_file(binary.cameras) && is_colmap_file(binary.images) ? binary : files(".txt");
}

template <typename Number>
Number colmap_at(std::string_view bytes, std::size_t position) {
  Number value;
  std::memcpy(&value, bytes.data() + position, sizeof(Number));
  return value;
}

/// Whether the first record of cameras.bin is plausible: number, model, width, height.
bool is_colmap_binary_cameras(std::string_view head) {
  if (head.size() < 8 + kColmapCameraBytes || colmap_at<std::uint64_t>(head, 0) == 0) return false;
  const auto model = colmap_at<std::int32_t>(head, 12);
  return model >= 0 && model < kColmapMaxModel && is_colmap_side(colmap_at<std::uint64_t>(head, 16)) &&
         is_colmap_side(colmap_at<std::uint64_t>(head, 24));
}

/// Whether the first record of images.bin begins with a number and a quaternion of length 1.
bool is_colmap_binary_images(std::string_view head) {
  if (head.size() < 8 + kColmapImageBytes || colmap_at<std::uint64_t>(head, 0) == 0) return false;
  double squares = 0;
  for (std::size_t i = 0; i < 4; ++i) squares += std::pow(colmap_at<double>(head, 12 + 8 * i), 2);
  return std::abs(squares - 1) < 0.1;
}

bool is_colmap_text_cameras(std::string_view head) {
  ColmapLines lines(head);
  if (!lines.next_record()) return head.find("CAMERA_ID, MODEL, WIDTH, HEIGHT") != std::string_view::npos;
  const auto tokens = colmap_tokens(lines.line());
  if (tokens.size() < 5 || !colmap_integer(tokens[0]) || !colmap_integer(tokens[2]) || !colmap_integer(tokens[3]))
    return false;
  return tokens[1].find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_") == std::string_view::npos;
}

bool is_colmap_text_images(std::string_view head) {
  ColmapLines lines(head);
  if (!lines.next_record()) return head.find("IMAGE_ID, QW, QX, QY, QZ") != std::string_view::npos;
  const auto tokens = colmap_tokens(lines.line());
  if (tokens.size() < 10 || !colmap_integer(tokens[0]) || !colmap_integer(tokens[8])) return false;
  return std::all_of(tokens.begin() + 1, tokens.begin() + 8,
                     [](std::string_view token) { return parse_number(token); });
}

Camera colmap_camera(const ColmapImage& image, const ColmapContent& content, const std::string& cameras_file) {
  const auto found = content.cameras.find(image.camera);
  if (found == content.cameras.end())
    fail_at(image.where, "reading a camera calibration: image \"{}\" is of camera {}, which {} does not list",
            excerpt(image.name), image.camera, cameras_file);
  const ColmapCamera& lens = found->second;
  const ColmapModel* model = colmap_model(lens.model);
  if (!model || model->focal_lengths == 0)
    fail_at(lens.where, "reading a camera calibration: camera {} has the lens model {}; supported are {}", image.camera,
            excerpt(lens.model), kColmapReadable);
  if (lens.parameters.size() != model->parameters)
    fail_at(lens.where, "reading a camera calibration: camera {} has {} parameters, {} has {}", image.camera,
            lens.parameters.size(), model->name, model->parameters);
  if (!is_colmap_side(lens.width) || !is_colmap_side(lens.height))
    fail_at(lens.where, "reading a camera calibration: camera {} has images of {}x{}, allowed is 1 to {}", image.camera,
            lens.width, lens.height, kMaxImageSide);
  Camera camera;
  camera.name = image.name;
  camera.width = static_cast<int>(lens.width);
  camera.height = static_cast<int>(lens.height);
  const double* p = lens.parameters.data();
  const std::size_t focals = model->focal_lengths;
  camera.K = intrinsics(p[0], p[focals - 1], p[focals], p[focals + 1], PixelCentre::half);
  std::vector<double> coefficients(lens.parameters.begin() + static_cast<std::ptrdiff_t>(focals) + 2,
                                   lens.parameters.end());
  if (model->lens == Lens::fisheye) coefficients.resize(kFisheyeCoefficients, 0.0);
  set_distortion(camera, model->lens, coefficients, lens.where);
  const double* pose = image.pose;
  camera.R = rotation_from_quaternion(pose[0], pose[1], pose[2], pose[3], image.where);
  camera.t = {pose[4], pose[5], pose[6]};
  return camera;
}

bool are_same_colmap_cameras(const Camera& a, const Camera& b) {
  const bool same_pose = (a.R - b.R).cwiseAbs().maxCoeff() <= kColmapSamePose &&
                         (a.t - b.t).norm() <= kColmapSamePose * std::max(1.0, a.t.norm());
  return same_pose && a.width == b.width && a.height == b.height && a.K == b.K && a.lens == b.lens &&
         a.distortion == b.distortion;
}

std::string without_colmap_extension(const std::string& name) {
  const std::size_t folder_end = name.rfind('/') == std::string::npos ? 0 : name.rfind('/') + 1;
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos || dot <= folder_end ? name : name.substr(0, dot);
}

/// One camera for each folder of images. Nothing if an image has no folder, or if the images of a folder differ in pose
/// or lens.
std::vector<Camera> colmap_cameras_of_folders(const std::vector<Camera>& of_images) {
  std::vector<Camera> cameras;
  std::map<std::string, std::size_t> index;
  for (const Camera& camera : of_images) {
    const std::size_t slash = camera.name.rfind('/');
    if (slash == std::string::npos || slash == 0) return {};
    const auto [entry, is_new] = index.emplace(camera.name.substr(0, slash), cameras.size());
    if (!is_new && !are_same_colmap_cameras(cameras[entry->second], camera)) return {};
    if (!is_new) continue;
    cameras.push_back(camera);
    cameras.back().name = entry->first;
  }
  return cameras;
}

Calibration named_colmap_cameras(std::vector<Camera> of_images) {
  Calibration calibration;
  calibration.cameras = colmap_cameras_of_folders(of_images);
  if (!calibration.cameras.empty()) {
    calibration.notes.emplace_back(
        fmt::format("Each folder of images is one camera, because the images of a folder share one pose: {} images, {} "
                    "cameras.",
                    of_images.size(), calibration.cameras.size()));
    return calibration;
  }
  std::set<std::string> names;
  for (const Camera& camera : of_images) names.insert(without_colmap_extension(camera.name));
  // Names that differ only in the extension keep it.
  if (names.size() == of_images.size()) {
    for (Camera& camera : of_images) camera.name = without_colmap_extension(camera.name);
  }
  calibration.cameras = std::move(of_images);
  return calibration;
}

std::string colmap_numbers(std::initializer_list<double> numbers) {
  std::string text;
  for (double number : numbers) text += fmt::format(" {:.17g}", number);
  return text;
}

/// The model and the parameters of a lens.
std::string colmap_lens_text(const Camera& camera) {
  const auto& c = camera.distortion;
  if (camera.K(0, 1) != 0)
    fail("writing a camera calibration: camera {} has a skew of {}, which COLMAP cannot hold", camera.name,
         camera.K(0, 1));
  const std::string pinhole = colmap_numbers({camera.K(0, 0), camera.K(1, 1), camera.K(0, 2), camera.K(1, 2)});
  if (!camera.has_distortion()) return "PINHOLE" + pinhole;
  const std::string first = pinhole + colmap_numbers({c[0], c[1], c[2], c[3]});
  if (camera.lens == Lens::fisheye) return "OPENCV_FISHEYE" + first;
  if (camera.lens != Lens::opencv)
    fail("writing a camera calibration: camera {} has a polynomial lens (Metashape), which COLMAP cannot hold",
         camera.name);
  const auto is_used = [](double k) { return k != 0; };
  if (std::any_of(c.begin() + 8, c.end(), is_used))
    fail("writing a camera calibration: camera {} has thin prism or tilt coefficients, which COLMAP cannot hold",
         camera.name);
  if (std::none_of(c.begin() + 4, c.begin() + 8, is_used)) return "OPENCV" + first;
  return "FULL_OPENCV" + first + colmap_numbers({c[4], c[5], c[6], c[7]});
}

/// A COLMAP sparse model, as text or binary: `cameras` lists lenses, `images` the poses of images and their lenses.
/// X_cam = R(q) X + t with a Hamilton quaternion qw qx qy qz. The first pixel's centre is (0.5, 0.5). The unit and the
/// axes of the world are arbitrary. A reconstruction of a rig over time has many images of one camera, in one folder.
class ColmapCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "colmap"; }

  bool recognises(const CalibrationSource& source) const override {
    const ColmapFiles files = colmap_files(source);
    if (source.is_folder) {
      if (!is_colmap_file(files.cameras) || !is_colmap_file(files.images)) return false;
      const std::string head = read_head(files.cameras, kColmapHeadBytes);
      return files.is_binary ? is_colmap_binary_cameras(head) : is_colmap_text_cameras(head);
    }
    const std::filesystem::path file = source.path.filename();
    if (file == files.cameras.filename())
      return files.is_binary ? is_colmap_binary_cameras(source.head) : is_colmap_text_cameras(source.head);
    if (file == files.images.filename())
      return files.is_binary ? is_colmap_binary_images(source.head) : is_colmap_text_images(source.head);
    return false;
  }

  Calibration read(const CalibrationSource& source) const override {
    const ColmapFiles files = colmap_files(source);
    const ColmapContent content = files.is_binary ? ColmapBinaryReader().read(files.cameras, files.images)
                                                  : ColmapTextReader().read(files.cameras, files.images);
    if (content.images.empty())
      fail_at({files.images.string(), 0}, "reading a camera calibration: this COLMAP model ({}) lists no image",
              files.cameras.string());
    std::vector<Camera> cameras;
    for (const ColmapImage& image : content.images)
      cameras.push_back(colmap_camera(image, content, files.cameras.string()));
    Calibration calibration = named_colmap_cameras(std::move(cameras));
    calibration.has_scale = false;
    return calibration;
  }

  bool can_write() const override { return true; }
  bool writes_folder() const override { return true; }

  void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const override {
    std::string lenses = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
    std::string images =
        "# Two lines for each image; the second one, of its points, is empty.\n"
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n";
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const Camera& camera = cameras[i];
      check_writable(camera);
      const std::string lens = colmap_lens_text(camera);
      const std::size_t model_end = lens.find(' ');
      lenses += fmt::format("{} {} {} {}{}\n", i + 1, lens.substr(0, model_end), camera.width, camera.height,
                            lens.substr(model_end));
      Eigen::Quaterniond q = Eigen::Quaterniond(camera.R).normalized();
      if (q.w() < 0) q.coeffs() *= -1;
      const std::string pose = colmap_numbers({q.w(), q.x(), q.y(), q.z(), camera.t.x(), camera.t.y(), camera.t.z()});
      images += fmt::format("{}{} {} {}.png\n\n", i + 1, pose, i + 1, camera.name);
    }
    write_atomically(path / "cameras.txt", lenses);
    write_atomically(path / "images.txt", images);
    write_atomically(path / "points3D.txt",
                     "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n");
  }

 private:
  static void check_writable(const Camera& camera) {
    if (camera.width <= 0 || camera.height <= 0)
      fail("writing a camera calibration: camera {} has no image size, which COLMAP needs", camera.name);
    const bool has_blank = std::any_of(camera.name.begin(), camera.name.end(),
                                       [](unsigned char c) { return std::isspace(c) || std::iscntrl(c); });
    if (camera.name.empty() || has_blank)
      fail("writing a camera calibration: the name \"{}\" must be one word, because COLMAP cuts names at a blank",
           camera.name);
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_colmap_calibration() { return std::make_unique<ColmapCalibration>(); }

}  // namespace doppel
