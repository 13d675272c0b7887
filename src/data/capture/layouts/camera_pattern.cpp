#include "doppel/data/capture/layouts/camera_pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/path_pattern.h"

namespace doppel {

namespace {

bool is_digit_at(const std::string& text, std::size_t i) {
  return i < text.size() && std::isdigit(static_cast<unsigned char>(text[i]));
}
bool is_letter_at(const std::string& text, std::size_t i) {
  return i < text.size() && std::isalpha(static_cast<unsigned char>(text[i]));
}

/// Whether a word or a number goes on from `i - 1` to `i`.
bool goes_on(const std::string& text, std::size_t i) {
  return i > 0 &&
         ((is_digit_at(text, i - 1) && is_digit_at(text, i)) || (is_letter_at(text, i - 1) && is_letter_at(text, i)));
}

/// The path with every name of the camera replaced by `{name}`, outside of placeholders and not within words.
std::string with_name(const std::string& path, const std::string& name) {
  std::string pattern;
  for (std::size_t i = 0; i < path.size();) {
    const bool here = !name.empty() && path.compare(i, name.size(), name) == 0;
    if (path[i] == '{') {
      const std::size_t end = std::min(path.find('}', i), path.size() - 1) + 1;
      pattern += path.substr(i, end - i);
      i = end;
    } else if (here && !goes_on(path, i) && !goes_on(path, i + name.size())) {
      pattern += "{name}";
      i += name.size();
    } else {
      pattern += path[i++];
    }
  }
  return pattern;
}

/// The path with every number that is the index of the camera replaced by `{camera}`, outside of placeholders.
std::string with_index(const std::string& path, int camera) {
  std::string pattern;
  for (std::size_t i = 0; i < path.size();) {
    std::size_t end = i;
    while (is_digit_at(path, end)) ++end;
    if (end == i) {
      end = path[i] == '{' ? std::min(path.find('}', i), path.size() - 1) + 1 : i + 1;
      pattern += path.substr(i, end - i);
    } else {
      const std::string digits = path.substr(i, end - i), index = std::to_string(camera);
      if (digits == index)
        pattern += "{camera}";
      else if (digits == fmt::format("{:0{}}", camera, digits.size()))
        pattern += fmt::format("{{camera:0{}}}", digits.size());
      else
        pattern += digits;
    }
    i = end;
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
    const std::string by_name = with_name(entry.second, names[as_size(entry.first)]);
    const std::string by_index = with_index(entry.second, entry.first);
    for (const std::string& pattern : {by_name, by_index})
      if (fits(pattern, by_camera, names)) return pattern;
  }
  std::map<std::string, std::string> paths;
  for (const auto& [camera, path] : by_camera) paths[names[as_size(camera)]] = path;
  return CameraPaths(std::move(paths));
}

}  // namespace doppel
