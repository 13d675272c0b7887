#include "doppel/data/capture/layouts/file_streams.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "doppel/core/lower_case.h"
#include "doppel/data/capture/layouts/frame_folders.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/frame_names.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxFrameDigits = 18;  // of a frame number
constexpr std::size_t kMaxTimeDigits = 20;   // nanoseconds since 1970 have 19

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

/// Whether the word before a column of digits says that they number the cameras.
bool numbers_cameras(const CutPath& file, std::size_t column) {
  const std::string text = lower_case(file.texts[column]);
  const std::size_t end = text.find_last_not_of("_- ");
  std::size_t begin = end + 1;
  while (begin > 0 && std::isalpha(static_cast<unsigned char>(text[begin - 1]))) --begin;
  const std::string word = end == std::string::npos ? "" : text.substr(begin, end + 1 - begin);
  return is_camera_word(word);
}

/// The column of digits that counts the frames, if any column varies: that with most values, and one that numbers the
/// cameras only where no other varies.
/// @param most_digits of numbers that may be frames
std::size_t frame_column(const std::vector<const CutPath*>& files, std::size_t most_digits = kMaxFrameDigits) {
  std::size_t best = 0;
  std::pair<bool, std::size_t> most{false, 1};  // no number of a camera; values
  for (std::size_t column = 0; column < files.front()->digits.size(); ++column) {
    std::set<std::string> values;
    for (const CutPath* file : files) values.insert(file->digits[column]);
    const bool usable =
        std::all_of(values.begin(), values.end(), [&](const auto& v) { return v.size() <= most_digits; });
    const std::pair found(!numbers_cameras(*files.front(), column), values.size());
    if (!usable || values.size() < 2 || found < most) continue;
    most = found;
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

/// The common difference of ascending numbers; 1 for less than three.
long step_of(const std::vector<long>& numbers) {
  if (numbers.size() < 3) return 1;
  const long step = numbers[1] - numbers[0];
  for (std::size_t i = 2; i < numbers.size(); ++i)
    if (numbers[i] - numbers[i - 1] != step) return 1;
  return std::max(step, 1L);
}

/// The stream of files that differ in the digits of one column alone.
FileStream frames_stream(const std::vector<const CutPath*>& files, std::size_t column) {
  const auto number = [&](const CutPath* file) { return std::strtol(file->digits[column].c_str(), nullptr, 10); };
  std::size_t shortest = kMaxFrameDigits, longest = 0;
  std::vector<long> numbers;
  for (const CutPath* file : files) {
    shortest = std::min(shortest, file->digits[column].size());
    longest = std::max(longest, file->digits[column].size());
    numbers.push_back(number(file));
  }
  std::sort(numbers.begin(), numbers.end());
  const CutPath* first = *std::min_element(files.begin(), files.end(),
                                           [&](const auto* a, const auto* b) { return number(a) < number(b); });
  FileStream stream = single_file(first->path);
  stream.path = first->without(column, shortest == longest ? fmt::format("{{frame:0{}}}", longest) : "{frame}");
  stream.files = static_cast<long>(files.size());
  stream.first_frame = numbers.front();
  stream.last_frame = numbers.back();
  stream.step = step_of(numbers);
  stream.per_frame = true;
  return stream;
}

/// Files by what their names are without the number in one column.
using FilesByRest = std::map<std::string, std::vector<const CutPath*>>;
FilesByRest by_rest(const std::vector<const CutPath*>& files, std::size_t column) {
  FilesByRest groups;
  for (const CutPath* file : files) groups[file->without(column, "#")].push_back(file);
  return groups;
}

/// Whether two of the groups have most of their numbers in common, as the frames of two cameras have.
bool share_numbers(const FilesByRest& groups, std::size_t column) {
  std::map<std::string, std::size_t> uses;
  for (const auto& [rest, files] : groups)
    for (const CutPath* file : files) ++uses[file->digits[column]];
  return 2 * static_cast<std::size_t>(
                 std::count_if(uses.begin(), uses.end(), [](const auto& use) { return use.second > 1; })) >
         uses.size();
}

/// Whether most numbers of some group follow each other, as frames do.
bool has_frames(const FilesByRest& groups, std::size_t column) {
  return std::any_of(groups.begin(), groups.end(), [&](const auto& group) {
    std::set<long> numbers;
    for (const CutPath* file : group.second)
      if (const std::string& digits = file->digits[column]; digits.size() <= kMaxFrameDigits)
        numbers.insert(std::strtol(digits.c_str(), nullptr, 10));
    const auto followed = static_cast<std::size_t>(
        std::count_if(numbers.begin(), numbers.end(), [&](long number) { return numbers.count(number + 1) > 0; }));
    return followed > 0 && 2 * followed + 1 >= numbers.size();
  });
}

/// Whether a file lacks nothing but the fraction of the second that others have in their names.
bool is_without_fraction(const CutPath& file, const CutPath& with) {
  const std::size_t n = file.digits.size();
  return n + 1 == with.digits.size() && (with.texts[n] == "." || with.texts[n] == ",") &&
         std::equal(file.texts.begin(), file.texts.end() - 1, with.texts.begin()) &&
         file.texts.back() == with.texts.back();
}

/// Whether the names of files that differ in numbers alone hold times.
/// @param all the files of this kind in their folder
bool are_times(const std::vector<const CutPath*>& files, const std::vector<const CutPath*>& all) {
  const bool alone = std::all_of(all.begin(), all.end(), [&](const CutPath* file) {
    return file->texts == files.front()->texts || is_without_fraction(*file, *files.front());
  });
  const std::size_t column = frame_column(files, kMaxTimeDigits);
  if (!alone || column == 0) return false;
  std::vector<std::string> names;
  for (const CutPath* file : files) names.push_back(file->path.substr(file->path.rfind('/') + 1));
  const FilesByRest groups = by_rest(files, column - 1);
  if (has_frames(groups, column - 1) || !hold_times(names)) return false;
  return are_dated(names) || !share_numbers(groups, column - 1);
}

FileStream folder_stream(const std::vector<const CutPath*>& files) {
  std::vector<std::string> paths;
  for (const CutPath* file : files) paths.push_back(file->path);
  FileStream stream = single_file(paths[order_of_names(paths).front()]);
  stream.files = static_cast<long>(files.size());
  stream.alone = true;
  stream.count_positions();
  return stream;
}

/// Adds the streams of files whose names have the same texts.
void add_streams(const std::vector<const CutPath*>& files, std::vector<FileStream>& streams) {
  const std::size_t column = frame_column(files);
  if (column == 0) {
    for (const CutPath* file : files) streams.push_back(single_file(file->path));
    return;
  }
  for (const auto& [rest, members] : by_rest(files, column - 1)) streams.push_back(frames_stream(members, column - 1));
}

}  // namespace

std::vector<FileStream> group_streams(const std::vector<std::string>& paths, bool per_frame) {
  std::vector<std::string> rest;
  std::copy_if(paths.begin(), paths.end(), std::back_inserter(rest), [](const std::string& path) {
    return path.find_first_of("{}") == std::string::npos;  // braces are placeholders in a capture.yaml
  });
  std::vector<FileStream> streams;
  if (per_frame) streams = take_frame_folders(rest);
  std::vector<CutPath> cut;
  for (const std::string& path : rest) {
    const FileKind kind = kind_of_file(path);
    const bool may_be_a_frame = kind == FileKind::image || kind == FileKind::json;
    if (per_frame && may_be_a_frame)
      cut.emplace_back(path);
    else if (kind != FileKind::other)
      streams.push_back(single_file(path));
  }
  std::map<std::vector<std::string>, std::vector<const CutPath*>> by_texts;
  std::map<std::pair<std::string, FileKind>, std::vector<const CutPath*>> in_folder;
  for (const CutPath& path : cut) {
    by_texts[path.texts].push_back(&path);
    in_folder[{folder_of(path.path), kind_of_file(path.path)}].push_back(&path);
  }
  std::set<std::string> folders_of_times;
  for (const auto& [texts, files] : by_texts) {
    const std::string folder = folder_of(files.front()->path);
    const std::vector<const CutPath*>& all = in_folder[{folder, kind_of_file(files.front()->path)}];
    if (!folder.empty() && are_times(files, all) && folders_of_times.insert(folder).second)
      streams.push_back(folder_stream(all));
  }
  for (const auto& [texts, files] : by_texts)
    if (folders_of_times.count(folder_of(files.front()->path)) == 0) add_streams(files, streams);
  for (FileStream& stream : streams)
    stream.alone =
        stream.alone || (stream.per_frame && static_cast<std::size_t>(stream.files) ==
                                                 in_folder[{folder_of(stream.first_file), stream.kind}].size());
  std::sort(streams.begin(), streams.end(),
            [](const FileStream& a, const FileStream& b) { return natural_less(a.first_file, b.first_file); });
  return streams;
}

}  // namespace doppel
