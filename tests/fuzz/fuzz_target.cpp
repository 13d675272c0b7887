#include "fuzz/fuzz_target.h"

#include <cstring>
#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/temporary_folder.h"

namespace doppel::fuzz {

void promise(bool kept, const std::string& what) {
  if (!kept) throw Broken("not kept: " + what);
}

std::filesystem::path written(std::string_view bytes, const std::filesystem::path& folder, const char* name) {
  std::ofstream(folder / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return folder / name;
}

std::vector<std::string_view> files_of(std::string_view bytes, std::size_t count) {
  std::vector<std::string_view> files(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t cut = i + 1 < count ? std::min(bytes.find(kNextFile), bytes.size()) : bytes.size();
    files[i] = bytes.substr(0, cut);
    bytes.remove_prefix(std::min(cut + std::strlen(kNextFile), bytes.size()));
  }
  return files;
}

std::filesystem::path spread(std::string_view bytes, const std::filesystem::path& folder,
                             const std::vector<const char*>& names) {
  const std::vector<std::string_view> files = files_of(bytes, names.size());
  for (std::size_t i = 0; i < names.size(); ++i) written(files[i], folder, names[i]);
  return folder / names[0];
}

std::string joined(const std::vector<std::string>& files) {
  std::string bytes = files[0];
  for (std::size_t i = 1; i < files.size(); ++i) bytes += kNextFile + files[i];
  return bytes;
}

std::string bytes_of(const char* name, const std::function<void(const std::filesystem::path&)>& write) {
  const support::TemporaryFolder folder;
  write(folder / name);
  return read_file(folder / name);
}

const std::vector<FuzzTarget>& all_targets() {
  static const std::vector<FuzzTarget> kTargets = [] {
    std::vector<FuzzTarget> targets;
    const auto add = [&](const std::vector<FuzzTarget>& part) {
      targets.insert(targets.end(), part.begin(), part.end());
    };
    add(scene_targets());
    add(character_targets());
    add(figure_targets());
    add(calibration_targets());
    add(keypoint_targets());
    add(file_targets());
    add(network_targets());
    add(archive_targets());
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
    const std::string message = e.what();
    promise(message.size() > 10, "a message says something");
    promise(message.size() < 4000, "a message can be read");
    return false;
  }
}

}  // namespace doppel::fuzz
