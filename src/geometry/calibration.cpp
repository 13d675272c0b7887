#include "doppel/geometry/calibration.h"

#include <algorithm>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/geometry/calibration_formats.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kMaxCalibrationBytes = 256 << 20;
constexpr std::size_t kHeadBytes = 4096;

std::vector<std::unique_ptr<CalibrationFormat>> all_formats() {
  std::vector<std::unique_ptr<CalibrationFormat>> formats;
  formats.push_back(make_skeletool_calibration());
  formats.push_back(make_opencv_calibration());
  return formats;
}

/// Names must be unique, because cameras are later found by name.
void check_cameras(const std::vector<Camera>& cameras, const FileLocation& where) {
  if (cameras.empty()) fail_at(where, "this calibration file holds no camera");
  std::set<std::string> names;
  for (const Camera& camera : cameras) {
    const std::vector<std::string> faults = camera.faults();
    if (!faults.empty()) fail_at(where, "{}", faults.front());
    if (!names.insert(camera.name).second) fail_at(where, "two cameras have the name \"{}\"", camera.name);
  }
}

}  // namespace

std::vector<Camera> read_calibration(const std::filesystem::path& path) {
  const std::string head = read_file(path, kMaxCalibrationBytes).substr(0, kHeadBytes);
  std::string names;
  for (const auto& format : all_formats()) {
    if (format->recognises(head)) {
      std::vector<Camera> cameras = format->read(path);
      check_cameras(cameras, {path.string(), 0});
      return cameras;
    }
    names += (names.empty() ? "" : ", ") + format->name();
  }
  fail_at({path.string(), 0}, "reading a calibration: the file has none of the known formats ({})", names);
}

void write_calibration(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  check_cameras(cameras, {path.string(), 0});
  for (const auto& format : all_formats()) {
    if (!format->writes(path.extension().string())) continue;
    write_atomically(path, [&](const std::filesystem::path& temporary) { format->write(temporary, cameras); });
    return;
  }
  fail("writing {}: found the extension \"{}\", allowed are .calibration, .yml, .yaml, .json, .xml", path.string(),
       path.extension().string());
}

}  // namespace doppel
