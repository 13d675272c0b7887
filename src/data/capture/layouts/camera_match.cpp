#include "doppel/data/capture/layouts/camera_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <numeric>
#include <set>

#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/frame_names.h"

namespace doppel {

namespace {

using Keys = std::map<std::string, int>;  ///< key -> index of the camera

/// A camera in the words of a part of a path: words `begin` to `end`.
struct CameraWords {
  std::size_t begin, end;
  int camera;
};

/// A part of a path: its words and the cameras in them.
struct PathPart {
  std::vector<NameWord> words;
  std::vector<CameraWords> cameras;
};
using WordedPath = std::vector<PathPart>;  ///< counted from the end: 0 is the file

/// The cameras in the words, from left to right. Of several that begin at a word, the longest.
std::vector<CameraWords> find_cameras(const std::vector<NameWord>& words, const Keys& keys) {
  std::vector<CameraWords> found;
  for (std::size_t begin = 0; begin < words.size();) {
    std::size_t end = words.size();
    for (; end > begin; --end) {
      const auto key = keys.find(joined_words(words, begin, end));
      if (key == keys.end()) continue;
      found.push_back({begin, end, key->second});
      break;
    }
    begin = std::max(begin + 1, end);
  }
  return found;
}

WordedPath worded(const std::string& path, const Keys& keys) {
  WordedPath result;
  for (const std::string& part : path_parts(path)) {
    std::vector<NameWord> words = words_of(part);
    std::vector<CameraWords> cameras = find_cameras(words, keys);
    result.insert(result.begin(), {std::move(words), std::move(cameras)});
  }
  return result;
}

/// Where the camera stands in the paths of a set: in which part, and as which of the cameras in it.
struct Position {
  std::size_t part = 0;
  bool last = true;

  std::optional<CameraWords> in(const WordedPath& path) const {
    if (part >= path.size() || path[part].cameras.empty()) return std::nullopt;
    return last ? path[part].cameras.back() : path[part].cameras.front();
  }
};

/// Whether a position names the same camera as another in all paths that have the other.
bool agrees(const Position& position, const Position& other, const std::vector<WordedPath>& paths) {
  return std::all_of(paths.begin(), paths.end(), [&](const WordedPath& path) {
    const auto wanted = other.in(path), found = position.in(path);
    return !wanted || (found && found->camera == wanted->camera);
  });
}

/// The words of a path in which the cameras at some positions are replaced by "#".
/// @param lowest the part with which to end
std::string without_cameras(const WordedPath& path, const std::vector<Position>& positions, std::size_t lowest = 0) {
  std::string text;
  for (std::size_t part = path.size(); part-- > lowest;) {
    std::vector<NameWord> words = path[part].words;
    for (const Position& position : positions)
      if (const auto found = position.part == part ? position.in(path) : std::nullopt)
        for (std::size_t i = found->begin; i < found->end; ++i) words[i] = {i == found->begin ? "#" : "", false};
    for (const NameWord& word : words)
      if (!word.text.empty()) text += word.text + " ";
    if (part > 0) text += "/ ";
  }
  return text;
}

/// The letters of the names below a part of a path; nothing without any number in them.
std::optional<std::string> letters_below(const WordedPath& path, std::size_t part) {
  std::string letters;
  bool numbered = false;
  for (std::size_t below = 0; below < std::min(part, path.size()); ++below)
    for (const NameWord& word : path[below].words) {
      numbered |= word.is_number;
      if (!word.is_number) letters += word.text + " ";
    }
  return numbered ? std::optional(letters) : std::nullopt;
}

/// Files that each camera has in a folder of its own and under names of its own, as cameras give them (GX010500.MP4),
/// belong together in their natural order, if all folders have as many. Names without numbers were given by a person,
/// and so tell sequences; names with other letters are joined only where no files belong together by their names.
class JoinedByOrder {
 public:
  JoinedByOrder(const std::vector<std::string>& paths, const std::vector<WordedPath>& worded, CameraMatch& match)
      : paths_(paths), worded_(worded), match_(match), any_letters_(match.largest_sequence() < 2) {}

  /// @param position where the cameras stand @param same the positions that name the same cameras
  void join(const Position& position, const std::vector<Position>& same) {
    if (position.part == 0) return;
    std::map<std::string, FilesOfCameras> groups, counted;
    std::map<std::string, std::set<int>> cameras;
    for (std::size_t i = 0; i < paths_.size(); ++i)
      if (match_.camera[i]) cameras[match_.sequence[i]].insert(*match_.camera[i]);
    for (std::size_t i = 0; i < paths_.size(); ++i) {
      const std::optional<std::string> letters = letters_below(worded_[i], position.part);
      if (!match_.camera[i] || !letters) continue;
      const std::string folder = without_cameras(worded_[i], same, position.part);
      std::string group = any_letters_ ? folder : folder + *letters;
      // A common number of two cameras' own counters is an accident.
      if (is_counter(*letters))
        counted[group][*match_.camera[i]].push_back(i);
      else if (cameras[match_.sequence[i]].size() == 1)
        groups[group][*match_.camera[i]].push_back(i);
    }
    for (auto& [folder, files] : counted)
      if (!have_same_names(files) && !join_group(folder, files)) add_lonely(files, cameras, groups[folder]);
    for (auto& [folder, files] : groups) join_group(folder, files);
  }

 private:
  using FilesOfCameras = std::map<int, std::vector<std::size_t>>;

  /// Whether cameras name their recordings by these letters and a number.
  static bool is_counter(const std::string& letters) {
    static const std::set<std::string> kCounters{"gx",  "gh",  "gopr", "gp",  "dsc", "dscf", "dscn", "img", "mvi",
                                                 "mov", "pxl", "vid",  "dji", "c",   "clip", "mah",  "p"};
    return kCounters.contains(letters.substr(0, letters.find(' ')));
  }

  /// Whether all cameras have files of the same names.
  bool have_same_names(const FilesOfCameras& by_camera) const {
    std::set<std::set<std::string>> all;
    for (const auto& [camera, files] : by_camera) {
      std::set<std::string> names;
      for (const std::size_t i : files) names.insert(match_.sequence[i]);
      all.insert(std::move(names));
    }
    return all.size() == 1;
  }

  /// Adds the files whose names no other camera has.
  void add_lonely(const FilesOfCameras& files, const std::map<std::string, std::set<int>>& cameras,
                  FilesOfCameras& group) const {
    for (const auto& [camera, of_camera] : files)
      for (const std::size_t i : of_camera)
        if (cameras.at(match_.sequence[i]).size() == 1) group[camera].push_back(i);
  }

  /// @return whether all cameras have as many files
  bool join_group(const std::string& name, FilesOfCameras& by_camera) {
    if (by_camera.size() < 2) return false;
    const std::size_t count = by_camera.begin()->second.size();
    const bool as_many = std::all_of(by_camera.begin(), by_camera.end(),
                                     [&](const auto& files) { return files.second.size() == count; });
    if (!as_many) return false;
    for (auto& [camera, files] : by_camera) {
      std::sort(files.begin(), files.end(), [&](auto a, auto b) { return natural_less(paths_[a], paths_[b]); });
      for (std::size_t i = 0; i < count; ++i)
        match_.sequence[files[i]] = count == 1 ? name : fmt::format("{}{}", name, i + 1);
    }
    return true;
  }

  const std::vector<std::string>& paths_;
  const std::vector<WordedPath>& worded_;
  CameraMatch& match_;
  bool any_letters_;
};

CameraMatch match_at(const Position& position, const std::vector<Position>& positions,
                     const std::vector<std::string>& names, const std::vector<WordedPath>& paths) {
  std::vector<Position> same;
  std::copy_if(positions.begin(), positions.end(), std::back_inserter(same),
               [&](const Position& other) { return agrees(other, position, paths); });
  CameraMatch match;
  for (const WordedPath& path : paths) {
    const auto found = position.in(path);
    match.camera.push_back(found ? std::optional(found->camera) : std::nullopt);
    match.sequence.push_back(without_cameras(path, same));
  }
  JoinedByOrder(names, paths, match).join(position, same);
  return match;
}

/// Whether the words before a position name cameras or takes: the number of paths with a word as in "cam3", less those
/// with a word as in "take3".
int camera_words_at(const Position& position, const std::vector<WordedPath>& paths) {
  static const std::set<std::string> kCamera{"cam", "camera", "c", "view", "stream", "kamera", "gopro"},
      kTake{"take", "trial", "session", "seq", "sequence", "scene", "shot", "action", "rep", "run", "t", "s"};
  int sum = 0;
  for (const WordedPath& path : paths) {
    const auto found = position.in(path);
    if (!found || found->begin == 0) continue;
    const std::string& before = path[position.part].words[found->begin - 1].text;
    sum += static_cast<int>(kCamera.contains(before)) - static_cast<int>(kTake.contains(before));
  }
  return sum;
}

CameraMatch match_by_keys(const std::vector<std::string>& paths, const Keys& keys, CameraMatch::Way way) {
  std::vector<WordedPath> all;
  std::vector<Position> positions;
  for (const std::string& path : paths) {
    all.push_back(worded(path, keys));
    for (std::size_t part = positions.size() / 2; part < all.back().size(); ++part)
      for (const bool last : {true, false}) positions.push_back({part, last});
  }
  CameraMatch best;
  std::array<int, 3> most{0, 0, std::numeric_limits<int>::min()};
  for (const Position& position : positions) {
    CameraMatch match = match_at(position, positions, paths, all);
    const std::array<int, 3> found{match.largest_sequence(), match.num_matched(), camera_words_at(position, all)};
    if (found[1] == 0 || found <= most) continue;
    most = found;
    best = std::move(match);
    best.way = way;
  }
  return best;
}

Keys name_keys(const std::vector<std::string>& cameras) {
  Keys keys;
  for (std::size_t i = 0; i < cameras.size(); ++i) keys.emplace(normalised_name(cameras[i]), static_cast<int>(i));
  keys.erase("");
  return keys;
}

/// The last numbers of the names; empty when two are equal, or one has none.
Keys number_keys(const std::vector<std::string>& cameras) {
  Keys keys;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::vector<NameWord> words = words_of(cameras[i]);
    const auto last = std::find_if(words.rbegin(), words.rend(), [](const NameWord& word) { return word.is_number; });
    if (last == words.rend() || !keys.emplace(last->text, static_cast<int>(i)).second) return {};
  }
  return keys;
}

bool are_numbers(const std::vector<std::string>& cameras) {
  return std::all_of(cameras.begin(), cameras.end(), [](const std::string& name) {
    const std::vector<NameWord> words = words_of(name);
    return words.size() == 1 && words[0].is_number;
  });
}

/// Whether no file or no camera is left over.
bool leaves_nothing(const CameraMatch& match, std::size_t num_cameras) {
  const std::set<std::optional<int>> found(match.camera.begin(), match.camera.end());
  const bool all_files = found.count(std::nullopt) == 0;
  return all_files || found.size() - 1 == num_cameras;
}

/// Files that share a group are in the order of the cameras, if there are as many.
CameraMatch match_groups(const std::vector<std::string>& paths, const std::vector<std::string>& groups,
                         const std::vector<int>& camera_order) {
  std::map<std::string, std::vector<std::size_t>> members;
  for (std::size_t i = 0; i < paths.size(); ++i) members[groups[i]].push_back(i);
  CameraMatch match;
  match.camera.resize(paths.size());
  match.sequence = groups;
  for (auto& [group, files] : members) {
    if (files.size() != camera_order.size()) continue;
    std::sort(files.begin(), files.end(), [&](auto a, auto b) { return natural_less(paths[a], paths[b]); });
    for (std::size_t i = 0; i < files.size(); ++i) match.camera[files[i]] = camera_order[i];
    match.way = CameraMatch::Way::order;
  }
  return match;
}

CameraMatch match_by_order(const std::vector<std::string>& paths, const std::vector<std::string>& cameras) {
  std::vector<int> order(cameras.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return natural_less(cameras[a], cameras[b]); });
  std::vector<std::string> all(paths.size()), folders, names;
  for (const std::string& path : paths) {
    folders.push_back(folder_of(path));
    names.push_back(path.substr(path.rfind('/') + 1));
  }
  for (const auto& groups : {all, folders, names})
    if (CameraMatch match = match_groups(paths, groups, order); match.way == CameraMatch::Way::order) return match;
  return {CameraMatch::Way::none, std::vector<std::optional<int>>(paths.size()), paths};
}

enum class Letter { other, digit, letter };
Letter letter_at(const std::string& text, std::size_t i) {
  const auto c = static_cast<unsigned char>(i < text.size() ? text[i] : ' ');
  return std::isdigit(c) ? Letter::digit : std::isalpha(c) ? Letter::letter : Letter::other;
}

/// Whether a word or a number goes on from `i - 1` to `i`.
bool goes_on(const std::string& text, std::size_t i) {
  return i > 0 && letter_at(text, i) != Letter::other && letter_at(text, i - 1) == letter_at(text, i);
}

/// The path with replacements, outside of placeholders.
/// @param replace (position, &text) -> how many letters of the path the text replaces; 0: none
template <typename Replace>
std::string replaced(const std::string& path, Replace replace) {
  std::string pattern;
  for (std::size_t i = 0, length = 0; i < path.size(); i += length) {
    std::string text;
    length = path[i] == '{' ? 0 : replace(i, text);
    if (length == 0) {
      length = path[i] == '{' ? std::min(path.find('}', i), path.size() - 1) + 1 - i : 1;
      text = path.substr(i, length);
    }
    pattern += text;
  }
  return pattern;
}

/// The path with every name of the camera replaced by `{name}`, not within words.
std::string with_name(const std::string& path, const std::string& name) {
  return replaced(path, [&](std::size_t i, std::string& text) {
    const bool here = path.compare(i, name.size(), name) == 0 && !goes_on(path, i) && !goes_on(path, i + name.size());
    text = "{name}";
    return here ? name.size() : 0;
  });
}

/// The path with every number that is the index of the camera replaced by `{camera}`.
std::string with_index(const std::string& path, int camera) {
  return replaced(path, [&](std::size_t i, std::string& text) {
    std::size_t digits = 0;
    while (letter_at(path, i + digits) == Letter::digit) text += path[i + digits++];
    if (text == std::to_string(camera))
      text = "{camera}";
    else if (digits > 0 && text == fmt::format("{:0{}}", camera, digits))
      text = fmt::format("{{camera:0{}}}", digits);
    return digits;
  });
}

bool fits(const std::string& pattern, const std::map<int, std::string>& by_camera,
          const std::vector<std::string>& names) {
  return std::all_of(by_camera.begin(), by_camera.end(), [&](const auto& entry) {
    return expand_camera(pattern, entry.first, names[entry.first]) == entry.second;
  });
}

}  // namespace

int CameraMatch::num_matched() const {
  return static_cast<int>(std::count_if(camera.begin(), camera.end(), [](const auto& c) { return c.has_value(); }));
}

int CameraMatch::largest_sequence() const {
  std::map<std::string, std::set<int>> cameras;
  for (std::size_t i = 0; i < camera.size(); ++i)
    if (camera[i]) cameras[sequence[i]].insert(*camera[i]);
  std::size_t most = 0;
  for (const auto& [name, found] : cameras) most = std::max(most, found.size());
  return static_cast<int>(most);
}

CameraMatch match_cameras(const std::vector<std::string>& paths, const std::vector<std::string>& cameras) {
  if (cameras.size() == 1) return {CameraMatch::Way::order, std::vector<std::optional<int>>(paths.size(), 0), paths};
  const CameraMatch by_name = match_by_keys(paths, name_keys(cameras), CameraMatch::Way::name);
  const bool named = by_name.num_matched() > 0;
  if (named && (!are_numbers(cameras) || leaves_nothing(by_name, cameras.size()))) return by_name;
  const CameraMatch by_number = match_by_keys(paths, number_keys(cameras), CameraMatch::Way::number);
  if (by_number.num_matched() > 0 && leaves_nothing(by_number, cameras.size())) return by_number;
  return match_by_order(paths, cameras);
}

std::string to_string(CameraMatch::Way way) {
  constexpr std::array words{"not at all", "by name", "by number", "by order"};
  return words[static_cast<std::size_t>(way)];
}

CameraPaths paths_of_cameras(const std::map<int, std::string>& by_camera, const std::vector<std::string>& names) {
  if (by_camera.size() == 1) return by_camera.begin()->second;
  // The camera whose index has most digits shows best whether numbers are padded; the first one shows it if all are.
  for (const auto& entry : {*by_camera.begin(), *by_camera.rbegin()}) {
    const std::string by_name = with_name(entry.second, names[entry.first]);
    const std::string by_index = with_index(entry.second, entry.first);
    for (const std::string& pattern : {by_name, by_index})
      if (fits(pattern, by_camera, names)) return pattern;
  }
  std::map<std::string, std::string> paths;
  for (const auto& [camera, path] : by_camera) paths[names[camera]] = path;
  return CameraPaths(std::move(paths));
}

}  // namespace doppel
