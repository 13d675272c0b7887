#include "doppel/data/capture/layouts/name_words.h"

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
  constexpr std::size_t kMostLetters = 64;
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
  return text.empty() ? fallback : text.substr(0, kMostLetters);
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

}  // namespace doppel
