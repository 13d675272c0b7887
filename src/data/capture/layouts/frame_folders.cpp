#include "doppel/data/capture/layouts/frame_folders.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "doppel/data/capture/layouts/name_words.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxDigits = 18;   // of a frame number
constexpr std::size_t kManyFolders = 3;  // for each name in them: more than cameras would have

/// A path as `before` + `digits` + `after` + "/" + `name`: the digits are the last of the file's folder.
struct FileInFolder {
  std::string path, before, digits, after, name;

  long number() const { return std::stol(digits); }
};

bool is_numeral(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

std::optional<FileInFolder> in_numbered_folder(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return std::nullopt;
  const std::size_t above = slash == 0 ? std::string::npos : path.rfind('/', slash - 1);
  const std::size_t begin = above == std::string::npos ? 0 : above + 1;
  std::size_t end = slash;
  while (end > begin && !is_numeral(path[end - 1])) --end;
  std::size_t first = end;
  while (first > begin && is_numeral(path[first - 1])) --first;
  if (first == end || end - first > kMaxDigits) return std::nullopt;
  return FileInFolder{path, path.substr(0, first), path.substr(first, end - first), path.substr(end, slash - end),
                      path.substr(slash + 1)};
}

using Files = std::vector<FileInFolder>;
using FilesByName = std::map<std::string, std::vector<const FileInFolder*>>;

/// The placeholder of the folders' numbers.
std::string placeholder_of(const Files& files) {
  const std::size_t digits = files.front().digits.size();
  const bool padded =
      std::all_of(files.begin(), files.end(), [&](const FileInFolder& file) { return file.digits.size() == digits; });
  return padded ? fmt::format("{{frame:0{}}}", digits) : "{frame}";
}

/// The name with its numbers that are the folder's replaced.
std::string without_number(const FileInFolder& file, const std::string& placeholder) {
  std::string name;
  for (std::size_t i = 0; i < file.name.size();) {
    std::size_t end = i;
    while (end < file.name.size() && is_numeral(file.name[end])) ++end;
    const std::string digits = file.name.substr(i, end - i);
    name += digits.empty() ? file.name.substr(i, 1) : digits == file.digits ? placeholder : digits;
    i = std::max(end, i + 1);
  }
  return name;
}

bool has_word(const std::string& text, const std::set<std::string>& wanted) {
  const std::vector<NameWord> words = words_of(text);
  return std::any_of(words.begin(), words.end(), [&](const NameWord& word) { return wanted.contains(word.text); });
}

bool has_camera_word(const std::string& text) {
  const std::vector<NameWord> words = words_of(text);
  return std::any_of(words.begin(), words.end(), [](const NameWord& word) { return is_camera_word(word.text); });
}

/// Whether most folders hold files of all these names.
bool are_in_most(const FilesByName& names, std::size_t num_folders) {
  return std::all_of(names.begin(), names.end(),
                     [&](const auto& entry) { return 2 * entry.second.size() > num_folders; });
}

/// Whether the folders of files count the frames, by the names in them.
/// @param repeats whether the names repeat the number of their folder
bool count_frames(const Files& files, const FilesByName& names, std::size_t num_folders, bool repeats) {
  static const std::set<std::string> kFrameWords{"frame", "frames"},
      kNoFrameWords{"c", "take", "trial", "session", "scene"};
  const std::vector<std::string> parts = path_parts(files.front().path);
  const std::string &folder = parts[parts.size() - 2], above = parts.size() > 2 ? parts[parts.size() - 3] : "";
  if (num_folders < 2 || !are_in_most(names, num_folders)) return false;
  if (has_word(folder, kNoFrameWords) || has_camera_word(folder)) return false;
  const auto every = [&](auto holds) {
    return std::all_of(names.begin(), names.end(), [&](const auto& entry) {
      return holds(entry.first.substr(0, std::min(entry.first.rfind('.'), entry.first.find("{frame"))));
    });
  };
  const bool below_frames = has_word(above, kFrameWords);
  if (has_word(folder, kFrameWords)) return true;
  if (every([](const std::string& name) { return std::all_of(name.begin(), name.end(), is_numeral); }))
    return below_frames && num_folders > names.size();
  if ((below_frames && num_folders > names.size()) ||
      every([](const std::string& name) { return has_camera_word(name); }))
    return true;
  if (repeats) return false;
  if (every([](const std::string& name) { return std::none_of(name.begin(), name.end(), is_numeral); }))
    return names.size() > 1;
  return num_folders >= kManyFolders * names.size();
}

FileStream stream_of(const std::string& name, const std::vector<const FileInFolder*>& files,
                     const std::string& placeholder) {
  const auto [first, last] =
      std::minmax_element(files.begin(), files.end(),
                          [](const FileInFolder* a, const FileInFolder* b) { return a->number() < b->number(); });
  FileStream stream;
  stream.kind = kind_of_file((*first)->path);
  stream.path = (*first)->before + placeholder + (*first)->after + "/" + name;
  stream.first_file = (*first)->path;
  stream.files = static_cast<long>(files.size());
  stream.first_frame = (*first)->number();
  stream.last_frame = (*last)->number();
  stream.per_frame = true;
  return stream;
}

/// Adds the streams of files in folders that differ in their number alone, if these count the frames.
bool add_streams(const Files& files, std::vector<FileStream>& streams) {
  std::set<std::string> folders;
  FilesByName names, without;
  const std::string placeholder = placeholder_of(files);
  for (const FileInFolder& file : files) {
    folders.insert(file.digits);
    names[file.name].push_back(&file);
    without[without_number(file, placeholder)].push_back(&file);
  }
  const bool plain = count_frames(files, names, folders.size(), false);
  if (!plain && !count_frames(files, without, folders.size(), true)) return false;
  for (const auto& [name, members] : plain ? names : without) streams.push_back(stream_of(name, members, placeholder));
  return true;
}

}  // namespace

std::vector<FileStream> take_frame_folders(std::vector<std::string>& paths) {
  std::map<std::tuple<std::string, std::string, FileKind>, Files> groups;
  for (const std::string& path : paths)
    if (const FileKind kind = kind_of_file(path); kind == FileKind::image || kind == FileKind::json)
      if (auto file = in_numbered_folder(path)) groups[{file->before, file->after, kind}].push_back(std::move(*file));
  std::vector<FileStream> streams;
  std::set<std::string> taken;
  for (const auto& [key, files] : groups)
    if (add_streams(files, streams))
      for (const FileInFolder& file : files) taken.insert(file.path);
  paths.erase(std::remove_if(paths.begin(), paths.end(), [&](const std::string& path) { return taken.contains(path); }),
              paths.end());
  return streams;
}

}  // namespace doppel
