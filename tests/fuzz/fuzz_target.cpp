#include "fuzz/fuzz_target.h"

#include <fstream>

#include "doppel/core/error.h"

namespace doppel::fuzz {

void promise(bool kept, const std::string& what) {
  if (!kept) throw Broken("not kept: " + what);
}

std::filesystem::path written(std::string_view bytes, const std::filesystem::path& folder, const char* name) {
  std::ofstream(folder / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return folder / name;
}

const std::vector<FuzzTarget>& all_targets() {
  static const std::vector<FuzzTarget> kTargets = [] {
    std::vector<FuzzTarget> targets;
    for (const auto& part : {scene_targets(), character_targets(), calibration_targets(), file_targets()})
      targets.insert(targets.end(), part.begin(), part.end());
    return targets;
  }();
  return kTargets;
}

const FuzzTarget& target_of(const std::string& name) {
  std::string known;
  for (const FuzzTarget& target : all_targets()) {
    if (target.name == name) return target;
    known += (known.empty() ? "" : ", ") + target.name;
  }
  throw Broken("there is no target '" + name + "'; known are " + known);
}

bool run_once(const FuzzTarget& target, std::string_view bytes, const std::filesystem::path& folder) {
  try {
    target.read(bytes, folder);
    return true;
  } catch (const Error& e) {
    promise(std::string(e.what()).size() > 10, "a message says something");
    promise(std::string(e.what()).size() < 4000, "a message can be read");
    return false;
  }
}

}  // namespace doppel::fuzz
