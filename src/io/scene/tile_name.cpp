#include "doppel/io/scene/tile_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace doppel {

namespace {

constexpr int kFirstUdim = 1001, kLastUdim = kFirstUdim + kTilesAlongU * kTilesAlongV - 1;
constexpr std::size_t kUdimDigits = 4;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Where a word stands in a text, without regard to the case.
std::size_t find_word(std::string_view text, std::string_view word) {
  const auto found = std::search(text.begin(), text.end(), word.begin(), word.end(),
                                 [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); });
  return found == text.end() ? text.npos : static_cast<std::size_t>(found - text.begin());
}

std::optional<TileName> pattern_of(std::string_view name) {
  for (const auto& [word, numbering] : {std::pair("<udim>", TileName::Numbering::udim),
                                        {"%(udim)d", TileName::Numbering::udim},
                                        {"<uvtile>", TileName::Numbering::from_one}})
    if (const std::size_t at = find_word(name, word); at != name.npos)
      return TileName{std::string(name.substr(0, at)), std::string(name.substr(at + std::string_view(word).size())),
                      numbering, true};
  return std::nullopt;
}

/// The last four digits that stand alone and are the number of a tile.
std::optional<TileName> udim_of(std::string_view name, std::size_t file) {
  for (std::size_t end = name.size(); end > file;) {
    if (!is_digit(name[end - 1])) {
      --end;
      continue;
    }
    std::size_t begin = end;
    while (begin > file && is_digit(name[begin - 1])) --begin;
    const bool is_number = end - begin == kUdimDigits;
    const int number = is_number ? std::stoi(std::string(name.substr(begin, kUdimDigits))) : 0;
    if (number >= kFirstUdim && number <= kLastUdim)
      return TileName{std::string(name.substr(0, begin)), std::string(name.substr(end))};
    end = begin;
  }
  return std::nullopt;
}

/// `u<number>_v<number>` in the name of the file.
std::optional<TileName> uv_tile_of(std::string_view name, std::size_t file) {
  const auto digits = [&](std::size_t at) {
    std::size_t end = at;
    while (end < name.size() && end < at + 2 && is_digit(name[end])) ++end;
    return end;
  };
  for (std::size_t at = file; at + 4 < name.size(); ++at) {
    const bool starts = at == file || std::isalnum(static_cast<unsigned char>(name[at - 1])) == 0;
    if (!starts || std::tolower(static_cast<unsigned char>(name[at])) != 'u') continue;
    const std::size_t u_end = digits(at + 1);
    if (u_end == at + 1 || find_word(name.substr(u_end, 2), "_v") != 0) continue;
    const std::size_t v_end = digits(u_end + 2);
    if (v_end == u_end + 2) continue;
    const bool zero = name.substr(at + 1, u_end - at - 1) == "0" || name.substr(u_end + 2, v_end - u_end - 2) == "0";
    return TileName{std::string(name.substr(0, at)), std::string(name.substr(v_end)),
                    zero ? TileName::Numbering::from_zero : TileName::Numbering::from_one};
  }
  return std::nullopt;
}

}  // namespace

std::string TileName::of(int u, int v) const {
  const int first = numbering == Numbering::from_one ? 1 : 0;
  return before +
         (numbering == Numbering::udim ? std::to_string(kFirstUdim + u + kTilesAlongU * v)
                                       : fmt::format("u{}_v{}", u + first, v + first)) +
         after;
}

std::optional<TileName> tile_name_of(std::string_view name) {
  const std::size_t slash = name.find_last_of("/\\");
  const std::size_t file = slash == name.npos ? 0 : slash + 1;
  if (auto pattern = pattern_of(name)) return pattern;
  if (auto tile = uv_tile_of(name, file)) return tile;
  return udim_of(name, file);
}

}  // namespace doppel
