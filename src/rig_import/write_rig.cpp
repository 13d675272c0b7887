#include <algorithm>
#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/rig_import/import_rig.h"
#include "doppel/rig_import/landmarks_of_rig.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

Json position_json(const Eigen::Vector3d& position) { return {position.x(), position.y(), position.z()}; }

Json joints_json(const ImportedRig& rig) {
  Json report;
  for (int row = 0; row < 4; ++row) {
    Json numbers;
    for (int column = 0; column < 4; ++column) numbers.push_back(rig.file_from_character.matrix()(row, column));
    report["file_from_character"].push_back(numbers);
  }
  const auto in_file = [&](const ImportedJoint& joint) {
    return position_json(rig.file_from_character * joint.position);
  };
  for (std::size_t i = 0; i < kBodyLandmarks.size(); ++i) {
    const int joint = i < rig.landmark_joint.size() ? rig.landmark_joint[i] : -1;
    report["joints"][kBodyLandmarks[i]] = joint < 0 ? Json() : in_file(rig.joints[as_size(joint)]);
  }
  for (std::size_t i = 0; i < kBodyLandmarks.size(); ++i)
    if (i < rig.landmark_joint.size() && rig.landmark_joint[i] >= 0)
      report["landmark_joint"][kBodyLandmarks[i]] = rig.joints[as_size(rig.landmark_joint[i])].name;
  for (const ImportedJoint& joint : rig.joints)
    report["rig"].push_back({{"name", joint.name},
                             {"bone", joint.bone},
                             {"parent", joint.parent < 0 ? Json() : Json(rig.joints[as_size(joint.parent)].name)},
                             {"position", in_file(joint)}});
  return report;
}

Json motions_json(const ImportedRig& rig) {
  Json report;
  report["motions"] = Json::array();
  for (const ImportedMotion& motion : rig.motions)
    report["motions"].push_back({{"file", motion.file},
                                 {"animation", motion.animation},
                                 {"frames", motion.motion.num_frames()},
                                 {"frames_per_second", motion.frames_per_second},
                                 {"start_s", motion.start},
                                 {"error_mm", 1000 * motion.error}});
  return report;
}

void write_all(const fs::path& folder, const ImportedRig& rig) {
  write_character(folder, rig.character);
  for (const ImportedMotion& motion : rig.motions) write_motion(folder / motion.file, motion.motion);
  const auto count = static_cast<std::int64_t>(rig.vertex_map.size());
  const std::vector<std::int32_t> map(rig.vertex_map.begin(), rig.vertex_map.end());
  write_atomically(folder / "vertex_map.npy", npy_bytes(map.data(), "<i4", {count}));
  // Names of joints are any bytes; those that are no UTF-8 are replaced.
  const auto text = [](const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; };
  write_atomically(folder / "joints.json", text(joints_json(rig)));
  write_atomically(folder / "motions.json", text(motions_json(rig)));
}

/// Files of another character that load_character would read with this one.
void check_folder(const fs::path& folder, const std::string& name) {
  std::error_code none;
  if (!fs::exists(folder, none)) return;
  if (!fs::is_directory(folder, none)) fail<UsageError>("{} is a file; give a folder to write into", folder.string());
  if (fs::exists(folder / "segmentation.txt", none))
    fail<UsageError>(
        "{} holds a segmentation.txt of another character, which would be read with this one; give an empty folder",
        folder.string());
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (entry.path().extension() == ".character" && file != name + ".character")
      fail<UsageError>("{} holds another character, {}; give an empty folder", folder.string(), file);
  }
}

}  // namespace

fs::path write_imported_rig(const fs::path& folder, const ImportedRig& rig) {
  const std::string& name = rig.character.name;
  check_folder(folder, name);
  fs::path place = fs::absolute(folder).lexically_normal();
  if (place.filename().empty()) place = place.parent_path();
  const fs::path temporary = place.parent_path() / fmt::format(".{}.partial", place.filename().string());
  fs::remove_all(temporary);
  try {
    fs::create_directories(temporary);
    write_all(temporary, rig);
    fs::create_directories(place);
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(temporary)) files.push_back(entry.path());
    // The .character file last: a folder that has it is complete.
    std::stable_partition(files.begin(), files.end(), [](const fs::path& f) { return f.extension() != ".character"; });
    for (const fs::path& file : files) fs::rename(file, place / file.filename());
    fs::remove_all(temporary);
  } catch (const fs::filesystem_error& e) {
    std::error_code none;
    fs::remove_all(temporary, none);
    fail("the character cannot be written to {}: {}", folder.string(), e.code().message());
  } catch (...) {
    std::error_code none;
    fs::remove_all(temporary, none);
    throw;
  }
  return folder / (name + ".character");
}

}  // namespace doppel
