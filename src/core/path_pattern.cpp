#include "doppel/core/path_pattern.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr int kMaxDigits = 20;

/// Replaces every {key} or {key:0n} by the result of `value_of`; `nullopt` leaves the placeholder unchanged.
template <typename F>
std::string replace_placeholders(const std::string& pattern, const F& value_of) {
  std::string result;
  std::size_t at = 0;
  while (at < pattern.size()) {
    const std::size_t open = pattern.find('{', at);
    result += pattern.substr(at, open - at);
    if (open == std::string::npos) break;
    const std::size_t close = pattern.find('}', open);
    if (close == std::string::npos) fail("the path '{}' has an opening brace without a closing one", pattern);
    const std::string inside = pattern.substr(open + 1, close - open - 1);
    const std::size_t colon = inside.find(':');
    const std::optional<std::string> value =
        value_of(inside.substr(0, colon), colon == std::string::npos ? "" : inside.substr(colon + 1));
    result += value ? *value : pattern.substr(open, close - open + 1);
    at = close + 1;
  }
  return result;
}

std::string padded(long number, const std::string& format, const std::string& pattern) {
  int digits = 0;
  if (!format.empty()) {
    const std::optional<double> parsed = parse_number(format);
    if (!parsed || *parsed < 0 || *parsed > kMaxDigits || format.find_first_not_of("0123456789") != std::string::npos)
      fail("the path '{}' contains ':{}'; only a number of digits up to {} is allowed there, as in {{camera:03}}",
           pattern, format, kMaxDigits);
    digits = static_cast<int>(*parsed);
  }
  return fmt::format("{:0{}}", number, digits);
}

}  // namespace

std::string expand_pattern(const std::string& pattern, int camera, const std::string& name, std::optional<long> frame) {
  return replace_placeholders(pattern, [&](const std::string& key, const std::string& format) {
    if (key == "camera") return std::optional(padded(camera, format, pattern));
    if (key == "name" && format.empty()) return std::optional(name);
    if (key == "frame" && frame) return std::optional(padded(*frame, format, pattern));
    fail("the path '{}' has the placeholder '{{{}}}'; known are {{camera}}, {{name}} and {{frame}}", pattern,
         format.empty() ? key : key + ":" + format);
  });
}

std::string expand_camera(const std::string& pattern, int camera, const std::string& name) {
  return replace_placeholders(pattern, [&](const std::string& key, const std::string& format) {
    if (key == "camera") return std::optional(padded(camera, format, pattern));
    if (key == "name" && format.empty()) return std::optional(name);
    if (key == "frame") return std::optional<std::string>();
    fail("the path '{}' has the placeholder '{{{}}}'; known are {{camera}}, {{name}} and {{frame}}", pattern, key);
  });
}

void check_without_braces(const std::string& folder) {
  if (folder.find_first_of("{}") != std::string::npos)
    fail("the path {} has braces, which stand for placeholders in the paths of a capture; rename the folder", folder);
}

bool has_frame_placeholder(const std::string& pattern) {
  return pattern.find("{frame}") != std::string::npos || pattern.find("{frame:") != std::string::npos;
}

std::vector<long> frames_of_pattern(const std::string& pattern) {
  namespace fs = std::filesystem;
  const std::size_t open = pattern.find("{frame");
  const std::size_t slash = pattern.rfind('/', open);
  const std::size_t begin = slash == std::string::npos ? 0 : slash + 1;
  const std::string part = pattern.substr(begin, pattern.find('/', open) - begin);
  const fs::path folder = begin == 0 ? fs::path(".") : fs::path(pattern.substr(0, begin));
  std::vector<long> frames;
  if (!fs::is_directory(folder)) return frames;
  const std::string before = pattern.substr(begin, open - begin);
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, before.size(), before) != 0) continue;
    std::size_t end = before.size();
    while (end < name.size() && std::isdigit(static_cast<unsigned char>(name[end]))) ++end;
    if (end == before.size() || end - before.size() > 18) continue;
    const long frame = std::stol(name.substr(before.size(), end - before.size()));
    const bool exists = expand_pattern(part, 0, "", frame) == name &&
                        (entry.is_regular_file() || fs::is_regular_file(expand_pattern(pattern, 0, "", frame)));
    if (exists) frames.push_back(frame);
  }
  std::sort(frames.begin(), frames.end());
  return frames;
}

}  // namespace doppel
