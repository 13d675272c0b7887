#include "doppel/data/capture/layouts/file_streams.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/frame_names.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxFrameDigits = 18;  // of a frame number

std::string lowered_extension(const std::string& path) {
  const std::size_t dot = path.rfind('.'), slash = path.rfind('/');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return "";
  std::string extension = path.substr(dot + 1);
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension;
}

/// A path whose file name, up to the extension, is cut into texts and runs of digits: text, digits, ..., text.
struct CutPath {
  std::string path;
  std::vector<std::string> texts;   ///< [n + 1]; the first begins with the folder, the last ends with the extension
  std::vector<std::string> digits;  ///< [n]

  explicit CutPath(const std::string& whole) : path(whole) {
    const std::size_t slash = path.rfind('/'), name = slash == std::string::npos ? 0 : slash + 1;
    const std::size_t end = std::max(name, std::min(path.rfind('.'), path.size()));
    std::string text = path.substr(0, name);
    for (std::size_t i = name; i < end;) {
      if (!std::isdigit(static_cast<unsigned char>(path[i]))) {
        text += path[i++];
        continue;
      }
      const std::size_t begin = i;
      while (i < end && std::isdigit(static_cast<unsigned char>(path[i]))) ++i;
      texts.push_back(std::exchange(text, ""));
      digits.push_back(path.substr(begin, i - begin));
    }
    texts.push_back(text + path.substr(end));
  }
  std::string without(std::size_t column, const std::string& placeholder) const {
    std::string joined;
    for (std::size_t i = 0; i < digits.size(); ++i) joined += texts[i] + (i == column ? placeholder : digits[i]);
    return joined + texts.back();
  }
};

/// The column of digits that counts the frames, if any column varies.
std::size_t frame_column(const std::vector<const CutPath*>& files) {
  std::size_t best = 0, most = 1;
  for (std::size_t column = 0; column < files.front()->digits.size(); ++column) {
    std::set<std::string> values;
    for (const CutPath* file : files) values.insert(file->digits[column]);
    const bool usable =
        std::all_of(values.begin(), values.end(), [](const auto& v) { return v.size() <= kMaxFrameDigits; });
    if (!usable || values.size() < 2 || values.size() < most) continue;
    most = values.size();
    best = column + 1;
  }
  return best;  // 0: none, else the column + 1
}

FileStream single_file(const std::string& path) {
  FileStream stream;
  stream.kind = kind_of_file(path);
  stream.path = stream.first_file = path;
  return stream;
}

/// The stream of files that differ in the digits of one column alone.
FileStream frames_stream(const std::vector<const CutPath*>& files, std::size_t column) {
  const auto number = [&](const CutPath* file) { return std::strtol(file->digits[column].c_str(), nullptr, 10); };
  std::size_t shortest = kMaxFrameDigits, longest = 0;
  for (const CutPath* file : files) {
    shortest = std::min(shortest, file->digits[column].size());
    longest = std::max(longest, file->digits[column].size());
  }
  const CutPath* first = *std::min_element(files.begin(), files.end(),
                                           [&](const auto* a, const auto* b) { return number(a) < number(b); });
  FileStream stream = single_file(first->path);
  stream.path = first->without(column, shortest == longest ? fmt::format("{{frame:0{}}}", longest) : "{frame}");
  stream.files = static_cast<long>(files.size());
  stream.first_frame = number(first);
  stream.per_frame = true;
  return stream;
}

/// Adds the streams of files whose names have the same texts.
void add_streams(const std::vector<const CutPath*>& files, std::vector<FileStream>& streams) {
  const std::size_t column = frame_column(files);
  if (column == 0) {
    for (const CutPath* file : files) streams.push_back(single_file(file->path));
    return;
  }
  std::map<std::string, std::vector<const CutPath*>> by_rest;
  for (const CutPath* file : files) by_rest[file->without(column - 1, "#")].push_back(file);
  for (const auto& [rest, members] : by_rest) streams.push_back(frames_stream(members, column - 1));
}

}  // namespace

FileKind kind_of_file(const std::string& path) {
  static const std::map<std::string, FileKind> kinds{
      {"mp4", FileKind::video},  {"avi", FileKind::video},  {"mkv", FileKind::video},  {"mov", FileKind::video},
      {"m4v", FileKind::video},  {"webm", FileKind::video}, {"mpg", FileKind::video},  {"mpeg", FileKind::video},
      {"wmv", FileKind::video},  {"mts", FileKind::video},  {"m2ts", FileKind::video}, {"jpg", FileKind::image},
      {"jpeg", FileKind::image}, {"png", FileKind::image},  {"bmp", FileKind::image},  {"tif", FileKind::image},
      {"tiff", FileKind::image}, {"webp", FileKind::image}, {"json", FileKind::json},  {"csv", FileKind::table}};
  const auto found = kinds.find(lowered_extension(path));
  return found == kinds.end() ? FileKind::other : found->second;
}

std::string FileStream::stem() const {
  std::string text = path.substr(0, path.size() - lowered_extension(path).size());
  const std::size_t open = text.find("{frame");
  return open == std::string::npos ? text : text.erase(open, text.find('}', open) - open + 1);
}

std::vector<FileStream> group_streams(const std::vector<std::string>& paths, bool per_frame) {
  std::vector<CutPath> cut;
  std::vector<FileStream> streams;
  for (const std::string& path : paths) {
    const FileKind kind = kind_of_file(path);
    if (path.find_first_of("{}") != std::string::npos) continue;  // braces are placeholders in a capture.yaml
    const bool may_be_a_frame = kind == FileKind::image || kind == FileKind::json;
    if (per_frame && may_be_a_frame)
      cut.emplace_back(path);
    else if (kind != FileKind::other)
      streams.push_back(single_file(path));
  }
  std::map<std::vector<std::string>, std::vector<const CutPath*>> by_texts;
  for (const CutPath& path : cut) by_texts[path.texts].push_back(&path);
  for (const auto& [texts, files] : by_texts) add_streams(files, streams);
  std::sort(streams.begin(), streams.end(),
            [](const FileStream& a, const FileStream& b) { return natural_less(a.first_file, b.first_file); });
  return streams;
}

}  // namespace doppel
