#include <nlohmann/json.hpp>

#include "doppel/character/character_folder.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/json_bounds.h"
#include "doppel/core/npy.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/landmarks_of_rig.h"
#include "doppel/io/rig_import/motions_json.h"

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
    report["joints"][kBodyLandmarks[i]] = joint < 0 ? Json() : in_file(rig.joints[joint]);
  }
  for (std::size_t i = 0; i < kBodyLandmarks.size(); ++i)
    if (i < rig.landmark_joint.size() && rig.landmark_joint[i] >= 0)
      report["landmark_joint"][kBodyLandmarks[i]] = rig.joints[rig.landmark_joint[i]].name;
  for (const ImportedJoint& joint : rig.joints)
    report["rig"].push_back({{"name", joint.name},
                             {"bone", joint.bone},
                             {"parent", joint.parent < 0 ? Json() : Json(rig.joints[joint.parent].name)},
                             {"position", in_file(joint)}});
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
  write_atomically(folder / "motions.json", text(Json{{"motions", motions_json(rig)}}));
}

}  // namespace

Json motions_json(const ImportedRig& rig) {
  Json motions = Json::array();
  for (const ImportedMotion& motion : rig.motions)
    motions.push_back({{"file", motion.file},
                       {"animation", motion.animation},
                       {"frames", motion.motion.num_frames()},
                       {"frames_per_second", motion.frames_per_second},
                       {"start_s", motion.start},
                       {"error_mm", 1000 * motion.error}});
  return motions;
}

std::optional<double> imported_rate(const fs::path& motion) {
  const fs::path list = motion.parent_path() / "motions.json";
  std::error_code none;
  if (!fs::is_regular_file(list, none)) return std::nullopt;
  const std::string text = read_file(list);
  constexpr std::size_t kMaxDepth = 50;  // copies of a JSON value call themselves for each level
  const Json report = is_json_deeper_than(text, kMaxDepth) ? Json() : Json::parse(text, nullptr, false);
  if (!report.is_object() || !report.contains("motions") || !report["motions"].is_array())
    fail_at({list.string(), 0}, "is not the list of motions that `doppel character import` writes");
  for (const Json& entry : report["motions"]) {
    if (!entry.is_object() || entry.value("file", Json()) != motion.filename().string()) continue;
    const Json rate = entry.value("frames_per_second", Json());
    if (!rate.is_number() || !(rate.get<double>() > 0))
      fail_at({list.string(), 0}, "gives {} no positive `frames_per_second`", motion.filename().string());
    return rate.get<double>();
  }
  return std::nullopt;
}

fs::path write_imported_rig(const fs::path& folder, const ImportedRig& rig) {
  return write_character_folder(folder, rig.character.name, [&](const fs::path& target) { write_all(target, rig); });
}

}  // namespace doppel
