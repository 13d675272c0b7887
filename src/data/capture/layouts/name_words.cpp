#include "doppel/data/capture/layouts/name_words.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

namespace doppel {

namespace {

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
/// Bytes of UTF-8 beyond ASCII count as letters.
bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || (c & 0x80) != 0; }
bool is_upper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
char lowered(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

/// The run of digits that begins at `begin`, without leading zeros.
std::string_view number_at(std::string_view text, std::size_t begin, std::size_t& end) {
  for (end = begin; end < text.size() && is_digit(text[end]);) ++end;
  while (begin + 1 < end && text[begin] == '0') ++begin;
  return text.substr(begin, end - begin);
}

using Words = std::set<std::string>;

const Words kMaskWords{"mask",         "masks",        "msk",         "fg",    "foreground", "foregroundsegmentation",
                       "seg",          "silhouette",   "silhouettes", "matte", "alpha",      "mattes",
                       "segmentation", "segmentations"};
const Words kEmptyWords{"empty", "background", "backgrounds", "bg", "bkg", "backplate", "emptyscene"};
const Words kUnusedWords{"board",      "boards",     "checkerboard", "chessboard", "charuco", "calib",    "calibration",
                         "intrinsics", "extrinsics", "depth",        "normals",    "overlay", "overlays", "preview",
                         "previews",   "render",     "renders",      "debug",      "texture", "textures"};
const Words kKindWords{"video",     "videos",     "image",   "images",   "img",       "imgs",      "rgb",
                       "rgbs",      "frame",      "frames",  "cam",      "camera",    "cameras",   "view",
                       "views",     "stream",     "streams", "color",    "colour",    "raw",       "footage",
                       "recording", "recordings", "hd",      "keypoint", "keypoints", "openpose",  "mmpose",
                       "alphapose", "pose",       "poses",   "json",     "jsons",     "detection", "detections",
                       "people",    "c",          "d",       "data",     "cihp"};

/// The words of a path that are neither of a role nor of a kind.
std::vector<std::string> words_in_order(const std::string& path) {
  std::vector<std::string> telling;
  for (const NameWord& word : words_of(path))
    if (!kMaskWords.count(word.text) && !kEmptyWords.count(word.text) && !kKindWords.count(word.text))
      telling.push_back(word.text);
  return telling;
}

}  // namespace

std::vector<NameWord> words_of(std::string_view name) {
  std::vector<NameWord> words;
  for (std::size_t i = 0; i < name.size();) {
    if (is_digit(name[i])) {
      words.push_back({std::string(number_at(name, i, i)), true});
    } else if (is_letter(name[i])) {
      NameWord word;
      const std::size_t begin = i;
      for (; i < name.size() && is_letter(name[i]); ++i) {
        if (i > begin && is_upper(name[i]) && !is_upper(name[i - 1])) break;
        word.text += lowered(name[i]);
      }
      words.push_back(std::move(word));
    } else {
      ++i;
    }
  }
  return words;
}

std::string joined_words(const std::vector<NameWord>& words, std::size_t begin, std::size_t end) {
  std::string text;
  for (std::size_t i = begin; i < end; ++i) {
    if (i > begin && words[i].is_number && words[i - 1].is_number) text += '_';
    text += words[i].text;
  }
  return text;
}

std::string normalised_name(std::string_view name) {
  const std::vector<NameWord> words = words_of(name);
  return joined_words(words, 0, words.size());
}

std::string usable_name(std::string text, const std::string& fallback) {
  constexpr std::size_t kMaxLetters = 64;
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
  return text.empty() ? fallback : text.substr(0, kMaxLetters);
}

std::vector<std::string> path_parts(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    if (end > begin) parts.emplace_back(path.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

bool is_camera_word(const std::string& word) {
  return word == "cam" || word == "camera" || word == "view" || word == "kamera";
}

FileRole role_of_file(const std::string& path, const std::vector<std::string>& cameras) {
  std::vector<NameWord> words = words_of(path);
  const auto same = [](const NameWord& a, const NameWord& b) { return a.text == b.text; };
  for (const std::string& camera : cameras) {
    const std::vector<NameWord> own = words_of(camera);
    const auto found = std::search(words.begin(), words.end(), own.begin(), own.end(), same);
    if (found != words.end()) words.erase(found, found + static_cast<std::ptrdiff_t>(own.size()));
  }
  const auto has_word = [&](const Words& wanted) {
    return std::any_of(words.begin(), words.end(), [&](const NameWord& word) { return wanted.count(word.text) > 0; });
  };
  if (has_word(kUnusedWords)) return FileRole::unused;
  if (has_word(kEmptyWords)) return FileRole::empty;
  return has_word(kMaskWords) ? FileRole::masks : FileRole::footage;
}

std::set<std::string> telling_words(const std::string& path) {
  const std::vector<std::string> words = words_in_order(path);
  return {words.begin(), words.end()};
}

std::string telling_name(const std::string& path) { return fmt::format("{}", fmt::join(words_in_order(path), "_")); }

}  // namespace doppel
