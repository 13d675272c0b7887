#include "doppel/capture/camera_pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>

#include "doppel/capture/path_pattern.h"
#include "doppel/core/as_size.h"

namespace doppel {

namespace {

/// All occurrences of a text replaced.
std::string replaced_all(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; !from.empty() && (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

/// The path with every number that is the index of the camera replaced by `{camera}`, outside of placeholders.
std::string with_index(const std::string& path, int camera) {
  std::string pattern;
  for (std::size_t i = 0; i < path.size();) {
    if (path[i] == '{') {
      const std::size_t end = std::min(path.find('}', i), path.size() - 1) + 1;
      pattern += path.substr(i, end - i);
      i = end;
      continue;
    }
    std::size_t end = i;
    while (end < path.size() && std::isdigit(static_cast<unsigned char>(path[end]))) ++end;
    const std::string digits = path.substr(i, end - i);
    const bool is_index = !digits.empty() && digits == fmt::format("{:0{}}", camera, digits.size());
    const bool padded = digits.size() > 1 && digits != std::to_string(camera);
    pattern += !is_index ? digits : padded ? fmt::format("{{camera:0{}}}", digits.size()) : "{camera}";
    i = std::max(end, i + 1);
    if (digits.empty()) pattern += path[i - 1];
  }
  return pattern;
}

bool fits(const std::string& pattern, const std::map<int, std::string>& by_camera,
          const std::vector<std::string>& names) {
  return std::all_of(by_camera.begin(), by_camera.end(), [&](const auto& entry) {
    return expand_camera(pattern, entry.first, names[as_size(entry.first)]) == entry.second;
  });
}

}  // namespace

CameraPaths paths_of_cameras(const std::map<int, std::string>& by_camera, const std::vector<std::string>& names) {
  if (by_camera.size() == 1) return by_camera.begin()->second;
  // The camera whose index has most digits shows best whether numbers are padded; the first one shows it if all are.
  for (const auto& entry : {*by_camera.begin(), *by_camera.rbegin()}) {
    const std::string& name = names[as_size(entry.first)];
    const std::string by_name = replaced_all(entry.second, name, "{name}");
    const std::string by_index = with_index(entry.second, entry.first);
    for (const std::string& pattern : {by_name, by_index})
      if (fits(pattern, by_camera, names)) return pattern;
  }
  std::map<std::string, std::string> paths;
  for (const auto& [camera, path] : by_camera) paths[names[as_size(camera)]] = path;
  return CameraPaths(std::move(paths));
}

}  // namespace doppel
