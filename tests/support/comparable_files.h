#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "doppel/core/atomic_file.h"

namespace doppel::support {

/// Contents by names relative to a folder.
using Files = std::map<std::string, std::string>;

/// Removes what no two runs have alike: speeds and memory.
inline void remove_speeds(nlohmann::ordered_json& node) {
  if (node.is_object())
    for (const char* key :
         {"frames_per_second", "milliseconds", "latency_ms", "pictures_behind", "memory_mb", "seconds"})
      node.erase(key);
  for (nlohmann::ordered_json& child : node)
    if (child.is_structured()) remove_speeds(child);
}

/// A file's content as two runs of one command have it alike. @param name without its folder
inline std::string comparable(const std::string& name, std::string content) {
  if (name == "track.html") return std::regex_replace(content, std::regex("[0-9.]+ / s"), "");
  if (name != "track.json" && name != "refine.json" && name != "make.json") return content;
  nlohmann::ordered_json report = nlohmann::ordered_json::parse(content);
  remove_speeds(report);
  return report.dump(1);
}

/// The bytes of all files. The lock of a store is no part of it.
inline Files files_in(const std::filesystem::path& folder) {
  Files files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (entry.is_regular_file() && entry.path().filename() != "lock.mdb")
      files[name] = comparable(name, read_file(entry.path()));
  }
  return files;
}

}  // namespace doppel::support
