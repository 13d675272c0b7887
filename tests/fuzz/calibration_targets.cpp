#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "fuzz/calibration_seeds.h"
#include "fuzz/fuzz_target.h"

namespace doppel::fuzz {
namespace {

namespace fs = std::filesystem;

void check_calibration(const Calibration& calibration) {
  promise(!calibration.cameras.empty(), "a calibration has cameras");
  std::set<std::string> names;
  for (Camera camera : calibration.cameras) {
    if (camera.width == 0 && camera.height == 0) camera.width = camera.height = 1;
    promise(camera.faults().empty(), "cameras have no faults");
    promise(camera.centre().allFinite(), "cameras have a position");
    promise(names.insert(camera.name).second, "names of cameras differ");
  }
}

/// What was read survives writing and reading in Doppel's own format.
void check_rewritten(const Calibration& calibration, const fs::path& folder) {
  if (!calibration.has_poses) return;
  std::vector<Camera> cameras = calibration.cameras;
  for (Camera& camera : cameras)
    if (camera.width == 0) camera.width = camera.height = 640;
  write_calibration(folder / "again.yml", cameras, "opencv");
  const Calibration again = load_calibration(folder / "again.yml");
  promise(again.cameras.size() == cameras.size(), "all cameras are written");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera &a = cameras[i], &b = again.cameras[i];
    promise(a.name == b.name && a.width == b.width && a.height == b.height, "names and sizes survive");
    promise((a.K - b.K).norm() <= 1e-9 * a.K.norm() && (a.t - b.t).norm() <= 1e-9 * (1 + a.t.norm()),
            "numbers survive");
  }
}

FuzzTarget calibration_target(const std::string& format) {
  FuzzTarget target;
  target.name = "calibration_" + format;
  target.dictionary = {"!!opencv-matrix", "data: [",   "rows: 1e9", "1e200", "-1e308", ".Nan", "[[[[",
                       "{\"a\":",         "- - - -",   "&a [*a]",   "\"\":", "<_>",    "</_>", "0 0 0 0",
                       "../../x",         "\"name\":", "\t"};
  return target;
}

}  // namespace

std::vector<FuzzTarget> calibration_targets() {
  std::vector<FuzzTarget> targets;
  int number = 0;
  for (const CalibrationSeed& seed : calibration_seeds()) {
    FuzzTarget target = calibration_target(seed.format);
    for (const FuzzTarget& other : targets)
      if (other.name == target.name) target.name += "_" + std::to_string(++number);
    const std::vector<const char*> names = seed.file_names;
    target.read = [names](std::string_view bytes, const fs::path& folder) {
      for (const auto& entry : fs::directory_iterator(folder)) fs::remove_all(entry.path());
      const fs::path first = spread(bytes, folder, names);
      const Calibration calibration = load_calibration(names.size() > 1 ? folder : first);
      check_calibration(calibration);
      check_rewritten(calibration, folder);
    };
    target.seeds = {seed.bytes};
    targets.push_back(target);
  }
  return targets;
}

}  // namespace doppel::fuzz
