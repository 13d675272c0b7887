
#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/pickle.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kOpenCapMaxBytes = 16 << 20;
constexpr double kOpenCapMetresPerUnit = 0.001;

class OpenCapReader {
 public:
  explicit OpenCapReader(const std::filesystem::path& path) : path_(path), where_{path.string(), 0} {}

  Calibration read() const {
    const std::string file = read_file(path_, kOpenCapMaxBytes);
    const Pickle pickle = read_pickle(file, where_);
    Camera camera;
    camera.name = read_name();
    const std::vector<double> K = read_numbers(pickle.root, "intrinsicMat", 9);
    camera.K = intrinsics(K, PixelCentre::integer, where_);
    set_distortion(camera, Lens::opencv, read_numbers(pickle.root, "distortion", 0), where_);
    const std::vector<double> size = read_numbers(pickle.root, "imageSize", 2);
    camera.height = image_side(size[0], "imageSize", where_);
    camera.width = image_side(size[1], "imageSize", where_);
    Calibration calibration;
    calibration.unit = "mm";
    calibration.has_poses = pickle.root.find("rotation") || pickle.root.find("translation");
    if (calibration.has_poses) read_pose(pickle.root, camera);
    calibration.cameras.push_back(camera);
    return calibration;
  }

 private:
  /// The file has no name for its camera. OpenCap keeps one folder for each camera, and <phone>/Deployed for each model
  /// of phone.
  std::string read_name() const {
    std::error_code ignored;
    std::filesystem::path folder = std::filesystem::absolute(path_, ignored).parent_path();
    if (folder.filename() == "Deployed") folder = folder.parent_path();
    const std::string name = folder.filename().string();
    return name.empty() ? path_.stem().string() : name;
  }

  std::vector<double> read_numbers(const PickleValue& dictionary, const std::string& key, std::size_t count) const {
    return numbers(entry(dictionary, key, "the file", where_), count, key, where_);
  }

  void read_pose(const PickleValue& dictionary, Camera& camera) const {
    const std::vector<double> R = read_numbers(dictionary, "rotation", 9);
    const std::vector<double> t = read_numbers(dictionary, "translation", 3);
    camera.R = repaired_rotation(matrix_from_rows(R));
    camera.t = Eigen::Map<const Eigen::Vector3d>(t.data()) * kOpenCapMetresPerUnit;
  }

  std::filesystem::path path_;
  FileLocation where_;
};

/// cameraIntrinsics.pickle and cameraIntrinsicsExtrinsics.pickle of OpenCap: a dict with intrinsicMat, distortion
/// (k1 k2 p1 p2 k3) and imageSize, which is (height, width). The second one has rotation and translation too: X_cam =
/// rotation X + translation in millimetres, and the world is the checkerboard, which stands upright, so that the file
/// does not tell which axis points up. Pixel centres are at integers. A file holds one camera.
class OpenCapCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "opencap"; }
  bool recognises(const CalibrationSource& source) const override {
    if (source.is_folder || source.head.empty()) return false;
    // Protocols 2 to 5 begin with 0x80, the older ones with the opcodes of a dict.
    const char first = source.head[0];
    if (first != '\x80' && first != '}' && first != '(') return false;
    return source.head.find("intrinsicMat") != std::string::npos;
  }
  Calibration read(const CalibrationSource& source) const override { return OpenCapReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_opencap_calibration() { return std::make_unique<OpenCapCalibration>(); }

}  // namespace doppel
