#include <algorithm>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/pickle.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kZjuMaxBytes = 256 << 20;
constexpr std::size_t kZjuMaxCameras = 10000;
constexpr double kZjuMetresPerUnit = 0.001;
constexpr std::string_view kZjuMagic = "\x93NUMPY";

/// Where the pickle begins in a .npy file of objects; nothing for other files. core/npy.h reads arrays of numbers only.
std::optional<std::size_t> zju_pickle_begin(std::string_view file) {
  const auto byte = [&](std::size_t i) { return as_size(static_cast<unsigned char>(file[i])); };
  if (file.size() < 12 || file.substr(0, kZjuMagic.size()) != kZjuMagic) return std::nullopt;
  const bool first_version = byte(6) == 1;
  const std::size_t prefix = first_version ? 10 : 12;
  const std::size_t length =
      first_version ? byte(8) | byte(9) << 8 : byte(8) | byte(9) << 8 | byte(10) << 16 | byte(11) << 24;
  if (length > file.size() - prefix) return std::nullopt;
  const bool of_objects = file.substr(prefix, length).find("'|O'") != std::string_view::npos;
  return of_objects ? std::optional(prefix + length) : std::nullopt;
}

/// A path without its file, and the last folder of it.
std::pair<std::string, std::string> zju_folders(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  const std::size_t file = path.rfind('/');
  if (file == std::string::npos) return {};
  path.resize(file);
  return {path, path.substr(path.rfind('/') + 1)};
}

bool are_zju_names(const std::vector<std::string>& names) {
  const bool all = std::none_of(names.begin(), names.end(), [](const std::string& name) { return name.empty(); });
  return all && std::set<std::string>(names.begin(), names.end()).size() == names.size();
}

class ZjuReader {
 public:
  explicit ZjuReader(const std::filesystem::path& path) : where_{path.string(), 0} {}

  Calibration read() const {
    const std::string file = read_file(where_.file, kZjuMaxBytes);
    const auto begin = zju_pickle_begin(file);
    if (!begin) fail_at(where_, "reading a camera calibration: this is no .npy file of Python objects");
    const Pickle pickle = read_pickle(std::string_view(file).substr(*begin), where_);
    const auto objects = pickle.root.items();
    if (objects.size() != 1)
      fail_at(where_, "reading a camera calibration: the file holds {} objects, expected one dict", objects.size());
    const PickleValue cams = entry(objects[0], "cams", "the file", where_);
    Calibration calibration;
    calibration.unit = "mm";
    calibration.up = "+z";
    calibration.cameras = read_cameras(cams);
    name_cameras(objects[0], calibration);
    return calibration;
  }

 private:
  std::vector<Camera> read_cameras(const PickleValue& cams) const {
    const auto K = per_camera(cams, "K"), D = per_camera(cams, "D"), R = per_camera(cams, "R"),
               T = per_camera(cams, "T");
    if (D.size() != K.size() || R.size() != K.size() || T.size() != K.size())
      fail_at(where_, "reading a camera calibration: cams holds {} K, {} D, {} R and {} T, their numbers must be equal",
              K.size(), D.size(), R.size(), T.size());
    std::vector<Camera> cameras(K.size());
    for (std::size_t i = 0; i < K.size(); ++i) {
      cameras[i].name = std::to_string(i);
      require(R[i], 9, "R", i);
      require(T[i], 3, "T", i);
      require(K[i], 9, "K", i);
      cameras[i].K = intrinsics(K[i], PixelCentre::integer, where_);
      cameras[i].R = repaired_rotation(matrix_from_rows(R[i]));
      cameras[i].t = Eigen::Map<const Eigen::Vector3d>(T[i].data()) * kZjuMetresPerUnit;
      set_distortion(cameras[i], Lens::opencv, D[i], where_);
    }
    return cameras;
  }

  void require(const std::vector<double>& found, std::size_t count, const char* key, std::size_t camera) const {
    if (found.size() != count)
      fail_at(where_, "reading a camera calibration: cams.{} of camera {} has {} numbers, expected {}", key, camera,
              found.size(), count);
  }

  /// The numbers of every camera: of a list, or of an array whose first axis is the camera.
  std::vector<std::vector<double>> per_camera(const PickleValue& cams, const std::string& key) const {
    const PickleValue value = entry(cams, key, "cams", where_);
    const auto shape = value.shape();
    const bool is_numeric_array = shape && !shape->empty() && value.items().empty();
    const std::size_t count = is_numeric_array ? shape->front() : value.items().size();
    if (count > kZjuMaxCameras)
      fail_at(where_, "reading a camera calibration: cams.{} has {} cameras, allowed are {}", key, count,
              kZjuMaxCameras);
    std::vector<std::vector<double>> found;
    if (!is_numeric_array) {
      for (const PickleValue& item : value.items())
        found.push_back(numbers(item, 0, fmt::format("cams.{} of camera {}", key, found.size()), where_));
      return found;
    }
    const std::vector<double> all = numbers(value, 0, "cams." + key, where_);
    const std::size_t each = count == 0 ? 0 : all.size() / count;
    for (std::size_t i = 0; i < count; ++i)
      found.emplace_back(all.begin() + static_cast<std::ptrdiff_t>(i * each),
                         all.begin() + static_cast<std::ptrdiff_t>((i + 1) * each));
    return found;
  }

  /// Names the cameras by the folders of their first images. Without usable folders they keep their numbers.
  void name_cameras(const PickleValue& annotations, Calibration& calibration) const {
    const auto frames = annotations.find("ims");
    const auto first = frames && !frames->items().empty() ? frames->items()[0].find("ims") : std::nullopt;
    std::vector<Camera>& cameras = calibration.cameras;
    std::vector<std::string> whole, last;
    if (first && first->items().size() == cameras.size()) {
      for (const PickleValue& path : first->items()) {
        const auto [folder, name] = zju_folders(std::string(path.text()));
        whole.push_back(folder);
        last.push_back(name);
      }
    }
    const bool has_names = whole.size() == cameras.size();
    const std::vector<std::string>* names = nullptr;
    if (has_names && are_zju_names(last)) names = &last;
    if (!names && has_names && are_zju_names(whole)) names = &whole;
    if (!names) {
      calibration.notes.emplace_back(
          "The cameras are named by their numbers, because the image paths of the first frame do not name a folder for "
          "each of them.");
      return;
    }
    for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i].name = (*names)[i];
  }

  FileLocation where_;
};

/// annots.npy of ZJU-MoCap and of data sets that NeuralBody prepares: a dict in an array of one object,
/// {"cams": {"K", "D", "R", "T": one matrix per camera}, "ims": [{"ims": [path per camera]}, ...]}.
/// X_cam = R X + T with T in millimetres; D is k1 k2 p1 p2 k3; pixel centres are at integers; the world has z up.
/// The image size is not in the file.
class ZjuCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "zju"; }
  bool recognises(const CalibrationSource& source) const override {
    if (source.is_folder || !zju_pickle_begin(source.head)) return false;
    // The dict has two keys, so that one of them stands near its beginning.
    return source.head.find("cams") != std::string::npos || source.head.find("ims") != std::string::npos;
  }
  Calibration read(const CalibrationSource& source) const override { return ZjuReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_zju_calibration() { return std::make_unique<ZjuCalibration>(); }

}  // namespace doppel
