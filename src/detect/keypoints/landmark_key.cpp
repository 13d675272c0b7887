#include "doppel/detect/keypoints/landmark_key.h"

#include <algorithm>
#include <map>

namespace doppel {

namespace {

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_lower(char c) { return c >= 'a' && c <= 'z'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Whether a word begins at a letter inside of a name: `rightShoulder`, `LBigToe`, `R2D`.
bool begins_word(const std::string& name, std::size_t i) {
  if (i == 0 || !is_upper(name[i])) return false;
  return !is_upper(name[i - 1]) || (i + 1 < name.size() && is_lower(name[i + 1]));
}

std::vector<std::string> lower_case_words(const std::string& name) {
  std::vector<std::string> words(1);
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    const bool belongs = is_upper(c) || is_lower(c) || is_digit(c);
    if ((!belongs || begins_word(name, i)) && !words.back().empty()) words.emplace_back();
    if (belongs) words.back() += is_upper(c) ? static_cast<char>(c - 'A' + 'a') : c;
  }
  if (words.back().empty()) words.pop_back();
  return words;
}

/// "left", "right" or nothing.
std::string side_of(const std::string& word) {
  if (word == "l" || word == "left") return "left";
  return word == "r" || word == "right" ? "right" : "";
}

/// Takes the side from the first or the last word, and from the beginning of a single word: `leftear`.
std::string take_side(std::vector<std::string>& words) {
  if (words.size() > 1) {
    if (const std::string side = side_of(words.front()); !side.empty()) {
      words.erase(words.begin());
      return side;
    }
    if (const std::string side = side_of(words.back()); !side.empty()) {
      words.pop_back();
      return side;
    }
  }
  for (const std::string side : {"left", "right"}) {
    if (words.size() != 1 || !words.front().starts_with(side) || words.front() == side) continue;
    words.front().erase(0, side.size());
    return side;
  }
  return "";
}

/// Names of one part that do not depend on who uses them.
std::string main_synonym(const std::string& part, bool has_side) {
  static const std::map<std::string, std::string> middle{
      {"hip", "midhip"},      {"hips", "midhip"},      {"pelvis", "midhip"},    {"root", "midhip"},
      {"hipmid", "midhip"},   {"hipcenter", "midhip"}, {"hipcentre", "midhip"}, {"head", "headtop"},
      {"tophead", "headtop"}, {"topofhead", "headtop"}};
  static const std::map<std::string, std::string> sided{{"hallux", "bigtoe"}, {"littletoe", "smalltoe"}};
  const auto& synonyms = has_side ? sided : middle;
  const auto found = synonyms.find(part);
  return found == synonyms.end() ? part : found->second;
}

}  // namespace

std::string landmark_key(const std::string& name) {
  std::vector<std::string> words = lower_case_words(name);
  if (words.empty()) return name;
  const std::string side = take_side(words);
  std::string part;
  for (const std::string& word : words) part += word;
  part = main_synonym(part, !side.empty());
  return side.empty() ? part : side + "_" + part;
}

std::optional<int> find_landmark(const std::vector<std::string>& names, const std::string& name) {
  auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    const std::string key = landmark_key(name);
    found = std::find_if(names.begin(), names.end(), [&](const auto& other) { return landmark_key(other) == key; });
  }
  return found == names.end() ? std::nullopt : std::optional(static_cast<int>(found - names.begin()));
}

std::vector<int> mirrored_indices(const std::vector<std::string>& names) {
  std::map<std::string, int> index_of;
  for (std::size_t i = 0; i < names.size(); ++i) index_of.emplace(landmark_key(names[i]), static_cast<int>(i));
  std::vector<int> mirrored;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string key = landmark_key(names[i]);
    if (key.starts_with("left_"))
      key.replace(0, 4, "right");
    else if (key.starts_with("right_"))
      key.replace(0, 5, "left");
    const auto found = index_of.find(key);
    mirrored.push_back(found == index_of.end() ? static_cast<int>(i) : found->second);
  }
  return mirrored;
}

}  // namespace doppel
