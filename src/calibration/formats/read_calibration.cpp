#include "doppel/calibration/formats/read_calibration.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/file_head.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHeadBytes = 16 << 10;
constexpr double kMaxStudioSize = 30.0;                     // metres; cameras farther apart are in another unit
constexpr double kMinUpLength = 0.5, kMinUpCosine = 0.866;  // of the mean direction that is up in the images

CalibrationSource open_source(const fs::path& path) {
  CalibrationSource source{path, "", fs::is_directory(path)};
  if (source.is_folder) return source;
  if (!fs::is_regular_file(path) || !std::ifstream(path).is_open())
    fail_at({path.string(), 0}, "reading a camera calibration: there is no file that can be opened");
  source.head = read_head(path, kHeadBytes);
  return source;
}

double metres_per(const std::string& unit) {
  if (unit == "m") return 1.0;
  if (unit == "cm") return 0.01;
  if (unit == "mm") return 0.001;
  fail<UsageError>("a calibration's unit is \"{}\"; allowed are m, cm and mm", unit);
}

/// The largest distance between two cameras.
double extent(const std::vector<Camera>& cameras) {
  std::vector<Eigen::Vector3d> centres;
  centres.reserve(cameras.size());
  for (const Camera& camera : cameras) centres.push_back(camera.centre());
  double largest = 0.0;
  for (std::size_t i = 0; i < centres.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) largest = std::max(largest, (centres[i] - centres[j]).norm());
  return largest;
}

/// Scales lengths to metres where the format has not done so, or where the user knows another unit.
void settle_unit(Calibration& calibration, const std::string& wanted) {
  double scale = 1.0;
  if (!calibration.unit.empty()) {
    if (wanted.empty()) return;
    scale = metres_per(wanted) / metres_per(calibration.unit);
    if (wanted != calibration.unit)
      calibration.notes.push_back(
          fmt::format("the file or its format states the unit {}; the unit {} that was given is used instead",
                      calibration.unit, wanted));
    calibration.unit = wanted;
  } else {
    const double apart = wanted.empty() && calibration.has_scale ? extent(calibration.cameras) : 0.0;
    const bool millimetres = apart > kMaxStudioSize;
    calibration.unit = !wanted.empty() ? wanted : millimetres ? "mm" : "m";
    scale = metres_per(calibration.unit);
    if (wanted.empty() && !calibration.has_scale)
      calibration.notes.emplace_back("the lengths of this format have no scale; they were taken as metres");
    else if (wanted.empty() && calibration.has_poses)
      calibration.notes.emplace_back(
          fmt::format("the file does not state its unit; {} was assumed, because the cameras are up to {:.4g} apart",
                      calibration.unit == "m" ? "metres" : "millimetres", apart));
  }
  for (Camera& camera : calibration.cameras) camera.t *= scale;
}

/// Scaling may have made a position infinite, or so large that products with it are.
void check_positions(const std::vector<Camera>& cameras, const FileLocation& where) {
  for (const Camera& camera : cameras)
    if (!(camera.t.cwiseAbs().maxCoeff() <= kMaxMetres) || !camera.centre().allFinite())
      fail_at(where, "camera {} is {:.3g} m from the origin, allowed are {:g}; is the unit right?",
              excerpt(camera.name), camera.t.norm(), kMaxMetres);
}

/// The axis nearest to the mean direction that is up in the images; "unknown" when none is near.
std::string find_up(const std::vector<Camera>& cameras) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) mean -= camera.R.row(1).transpose() / static_cast<double>(cameras.size());
  if (!(mean.norm() > kMinUpLength)) return "unknown";
  Eigen::Index axis = 0;
  const double largest = mean.cwiseAbs().maxCoeff(&axis);
  if (largest < kMinUpCosine * mean.norm()) return "unknown";
  return std::string(mean[axis] > 0 ? "+" : "-") + "xyz"[axis];
}

/// Turns the world so that y is up.
void settle_up(Calibration& calibration, const std::string& wanted) {
  if (!wanted.empty()) {
    if (!calibration.up.empty() && wanted != calibration.up)
      calibration.notes.push_back(
          fmt::format("the file or its format states that {} is up; the axis {} that was given is used instead",
                      calibration.up, wanted));
    calibration.up = wanted;
  } else if (calibration.up.empty()) {
    calibration.up = calibration.has_poses ? find_up(calibration.cameras) : "unknown";
    if (calibration.has_poses)
      calibration.notes.emplace_back(
          calibration.up == "unknown"
              ? std::string("no axis of the file's world is up in the images; the axes were kept")
              : fmt::format("the file does not state which axis is up; {} was found, which is up in the images",
                            calibration.up));
  }
  if (calibration.up == "+y" || calibration.up == "unknown") return;
  const Eigen::Matrix3d turn = y_up_from_file(calibration.up);
  for (Camera& camera : calibration.cameras) camera.R = camera.R * turn.transpose();
}

/// Names become parts of paths of what is written for a camera, so none may lead out of a folder.
bool is_safe_name(const std::string& name) {
  constexpr std::size_t kMaxNameLength = 200;  // of a file name's 255 bytes
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  if (name.empty() || name.size() > kMaxNameLength || std::any_of(name.begin(), name.end(), is_control)) return false;
  std::string slashed = name;
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  const fs::path parts(slashed);
  return !parts.is_absolute() && std::none_of(parts.begin(), parts.end(), [](const fs::path& p) { return p == ".."; });
}

/// Whether all cameras have the same pose, as in a file that holds intrinsics and must state some pose.
bool have_one_pose(const std::vector<Camera>& cameras) {
  return cameras.size() > 1 && std::all_of(cameras.begin() + 1, cameras.end(), [&](const Camera& camera) {
           return camera.R == cameras[0].R && camera.t == cameras[0].t;
         });
}

/// Names must be unique, because cameras are later found by name.
void check_cameras(const std::vector<Camera>& cameras, const FileLocation& where) {
  if (cameras.empty()) fail_at(where, "this calibration holds no camera");
  std::set<std::string> names;
  for (Camera camera : cameras) {
    if (camera.width == 0 && camera.height == 0) camera.width = camera.height = 1;  // not stated
    const std::vector<std::string> faults = camera.faults();
    if (!faults.empty()) fail_at(where, "{}", faults.front());
    if (!is_safe_name(camera.name))
      fail_at(where,
              "camera {} has a name that cannot be part of a path; allowed are 1 to 200 characters without control "
              "characters, \"..\" and a leading slash; rename the camera in this file",
              names.size() + 1);
    if (!names.insert(camera.name).second) fail_at(where, "two cameras have the name \"{}\"", camera.name);
  }
}

std::string names_of(bool writers) {
  std::string names;
  for (const auto& format : calibration_formats())
    if (!writers || format->can_write()) names += (names.empty() ? "" : ", ") + format->name();
  return names;
}

const CalibrationFormat& writer(const fs::path& path, const std::string& name) {
  const std::string extension = path.extension().string();
  for (const auto& format : calibration_formats())
    if (format->can_write() && (name.empty() ? format->is_default_for(extension) : format->name() == name))
      return *format;
  if (!name.empty())
    fail<UsageError>("writing {}: the format \"{}\" cannot be written; allowed are {}", path.string(), name,
                     names_of(true));
  fail(
      "writing {}: found the extension \"{}\", allowed are .calibration, .yml, .yaml, .json, .xml; or name one of the "
      "formats {}",
      path.string(), extension, names_of(true));
}

void check_new_folder(const fs::path& path, const CalibrationFormat& format) {
  if (fs::exists(path) && !(fs::is_directory(path) && fs::is_empty(path)))
    fail<UsageError>("writing {}: this exists; the format {} writes a new folder", path.string(), format.name());
}

using CalibrationWriter = void (CalibrationFormat::*)(const fs::path&, const std::vector<Camera>&) const;

/// Writes into a folder beside `given` that takes its name when it is complete.
void write_folder(const fs::path& given, const std::vector<Camera>& cameras, const CalibrationFormat& format,
                  CalibrationWriter write) {
  const fs::path path = folder_path(given);
  check_new_folder(path, format);
  const fs::path making = path.parent_path() / fmt::format(".{}.making-{}", path.filename().string(), getpid());
  fs::remove_all(making);
  fs::create_directories(making);
  try {
    (format.*write)(making, cameras);
    fs::remove(path);
    fs::rename(making, path);
  } catch (...) {
    fs::remove_all(making);
    throw;
  }
}

void write_cameras(const fs::path& path, const std::vector<Camera>& cameras, const std::string& format,
                   CalibrationWriter write) {
  check_cameras(cameras, {path.string(), 0});
  const CalibrationFormat& chosen = writer(path, format);
  if (chosen.writes_folder()) return write_folder(path, cameras, chosen, write);
  write_atomically(path, [&](const fs::path& temporary) { (chosen.*write)(temporary, cameras); });
}

Calibration load_posed(const fs::path& path, const CalibrationOptions& options) {
  Calibration calibration = load_calibration(path, options);
  if (!calibration.has_poses)
    fail_at({path.string(), 0},
            "reading a camera calibration: this file ({}) holds intrinsics only; the poses of the cameras are needed",
            calibration.format);
  return calibration;
}

}  // namespace

Eigen::Matrix3d y_up_from_file(const std::string& up) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (up == "+y") return turn;
  if (up == "-y")
    turn << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  else if (up == "+z")
    turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  else if (up == "-z")
    turn << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  else if (up == "+x")
    turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  else if (up == "-x")
    turn << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  else
    fail<UsageError>("a calibration's up axis is \"{}\"; allowed are +x, -x, +y, -y, +z and -z", up);
  return turn;
}

bool is_calibration(const fs::path& path) {
  const CalibrationSource source = open_source(path);
  return std::any_of(calibration_formats().begin(), calibration_formats().end(),
                     [&](const auto& format) { return format->recognises(source); });
}

Calibration load_calibration(const fs::path& path, const CalibrationOptions& options) {
  CalibrationSource source = open_source(path);
  source.subject = options.subject;
  for (const auto& format : calibration_formats()) {
    if (!format->recognises(source)) continue;
    if (!options.subject.empty() && !format->has_subjects())
      fail<UsageError>("{}: the subject \"{}\" is named, but files of this format ({}) hold no subjects", path.string(),
                       options.subject, format->name());
    Calibration calibration = format->read(source);
    calibration.format = format->name();
    check_cameras(calibration.cameras, {path.string(), 0});
    if (calibration.has_poses && have_one_pose(calibration.cameras)) {
      calibration.has_poses = false;
      calibration.notes.emplace_back("all cameras have the same pose, so the file holds intrinsics without poses");
    }
    settle_unit(calibration, options.unit);
    check_positions(calibration.cameras, {path.string(), 0});
    settle_up(calibration, options.up);
    return calibration;
  }
  fail_at({path.string(), 0}, "reading a camera calibration: the {} has none of the known formats ({})",
          source.is_folder ? "folder" : "file", names_of(false));
}

std::vector<Camera> read_posed_cameras(const fs::path& path, const CalibrationOptions& options) {
  return load_posed(path, options).cameras;
}

std::vector<Camera> read_calibration(const fs::path& path, const CalibrationOptions& options) {
  Calibration calibration = load_posed(path, options);
  for (const Camera& camera : calibration.cameras)
    if (camera.width == 0)
      fail_at({path.string(), 0},
              "reading a camera calibration: this file ({}) does not state the size of camera {}'s images",
              calibration.format, camera.name);
  return std::move(calibration.cameras);
}

void write_calibration(const fs::path& path, const std::vector<Camera>& cameras, const std::string& format) {
  write_cameras(path, cameras, format, &CalibrationFormat::write);
}

void write_intrinsics(const fs::path& path, const std::vector<Camera>& cameras, const std::string& format) {
  write_cameras(path, cameras, format, &CalibrationFormat::write_intrinsics);
}

void check_calibration_target(const fs::path& path, const std::string& format, bool has_distortion) {
  const CalibrationFormat& chosen = writer(path, format);
  if (has_distortion && !chosen.holds_distortion())
    fail<UsageError>("writing {}: the format {} cannot hold lens distortion; write .yml or .toml", path.string(),
                     chosen.name());
  if (chosen.writes_folder()) return check_new_folder(folder_path(path), chosen);
  if (fs::is_directory(path)) fail<UsageError>("writing {}: a folder of this name already exists", path.string());
}

std::vector<std::string> calibration_writers() {
  std::vector<std::string> names;
  for (const auto& format : calibration_formats())
    if (format->can_write()) names.push_back(format->name());
  return names;
}

}  // namespace doppel
