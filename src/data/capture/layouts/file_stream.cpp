#include "doppel/data/capture/layouts/file_stream.h"

#include <map>

#include "doppel/core/lower_case.h"
#include "doppel/data/capture/layouts/name_words.h"

namespace doppel {

namespace {

std::string lowered_extension(const std::string& path) {
  const std::size_t dot = path.rfind('.'), slash = path.rfind('/');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return "";
  return lower_case(path.substr(dot + 1));
}

}  // namespace

FileKind kind_of_file(const std::string& path) {
  static const std::map<std::string, FileKind> kinds{
      {"mp4", FileKind::video},  {"avi", FileKind::video},  {"mkv", FileKind::video},  {"mov", FileKind::video},
      {"m4v", FileKind::video},  {"webm", FileKind::video}, {"mpg", FileKind::video},  {"mpeg", FileKind::video},
      {"wmv", FileKind::video},  {"mts", FileKind::video},  {"m2ts", FileKind::video}, {"jpg", FileKind::image},
      {"jpeg", FileKind::image}, {"png", FileKind::image},  {"bmp", FileKind::image},  {"tif", FileKind::image},
      {"tiff", FileKind::image}, {"webp", FileKind::image}, {"json", FileKind::json},  {"csv", FileKind::table},
      {"tsv", FileKind::table}};
  const auto found = kinds.find(lowered_extension(path));
  return found == kinds.end() ? FileKind::other : found->second;
}

std::string FileStream::stem() const {
  if (by_position) return path + "/.";
  std::string text = path.substr(0, path.size() - lowered_extension(path).size());
  const std::size_t open = text.find("{frame");
  return open == std::string::npos ? text : text.erase(open, text.find('}', open) - open + 1);
}

void FileStream::count_positions() {
  path = folder_of(first_file);
  first_frame = 0;
  last_frame = files - 1;
  per_frame = by_position = true;
}

}  // namespace doppel
