#include "doppel/io/scene/collada_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr long kMaxElementDepth = 200;
constexpr double kMaxStride = 1000;

/// Where the tag that begins at `at` ends; the end of the text for one that does not.
std::size_t end_of_tag(const std::string& text, std::size_t at) {
  if (text.compare(at, 4, "<!--") == 0) return text.find("-->", at);
  if (text.compare(at, 9, "<![CDATA[") == 0) return text.find("]]>", at);
  char quote = 0;
  for (++at; at < text.size(); ++at) {
    const char c = text[at];
    if (quote == 0 && c == '>') return at;
    if (quote != 0 ? c == quote : c == '"' || c == '\'') quote = quote == 0 ? c : '\0';
  }
  return std::string::npos;
}

/// The value of an attribute of a tag; nothing when the tag does not have it.
std::optional<std::string_view> attribute_of(std::string_view tag, std::string_view name) {
  const char* const blanks = " \t\r\n";
  for (std::size_t at = tag.find(name, 1); at != std::string_view::npos; at = tag.find(name, at + 1)) {
    if (!std::strchr(blanks, tag[at - 1])) continue;
    std::size_t next = tag.find_first_not_of(blanks, at + name.size());
    if (next == std::string_view::npos || tag[next] != '=') continue;
    next = tag.find_first_not_of(blanks, next + 1);
    if (next == std::string_view::npos || (tag[next] != '"' && tag[next] != '\'')) continue;
    const std::string_view rest = tag.substr(next + 1);
    return rest.substr(0, rest.find(tag[next]));
  }
  return std::nullopt;
}

/// Walks over the tags of a file and keeps what they announce.
class ColladaGuard {
 public:
  ColladaGuard(const std::filesystem::path& path, const std::string& text) : where_{path.string(), 0}, text_(text) {}

  void check() {
    long depth = 0;
    for (std::size_t at = text_.find('<'); at != std::string::npos; at = text_.find('<', at)) {
      const std::size_t end = end_of_tag(text_, at);
      if (end == std::string::npos) break;
      const char second = text_[at + 1];
      if (second == '/')
        --depth;
      else if (second != '!' && second != '?' && text_[end - 1] != '/')
        ++depth;
      if (depth > kMaxElementDepth)
        fail_at(where_, "the elements of the Collada file are nested more than {} deep", kMaxElementDepth);
      if (second != '!' && second != '?') read_tag(std::string_view(text_).substr(at, end - at), end);
      at = end;
    }
    check_accessors();
    for (const Skin& skin : skins_) check_skin(skin);
  }

 private:
  struct Accessor {
    std::string array;
    double count = 0, stride = 1, offset = 0;
    int params = 0;
  };
  struct Skin {
    std::string joints, matrices, weights;      ///< ids of sources
    std::array<double, 2> largest{-1.0, -1.0};  ///< index of a joint, of a weight
  };

  double number_of(std::string_view tag, const char* name, double largest, double usual) const {
    const auto value = attribute_of(tag, name);
    if (!value) return usual;
    const auto number = parse_number(*value);
    if (!number || !(*number >= 0) || *number > largest || value->find_first_not_of("0123456789") != value->npos)
      fail_at(where_, "an element of the Collada file has the {} '{}'; 0 to {} are possible in this file", name,
              value->substr(0, 40), largest);
    return *number;
  }
  static std::string id_of(std::string_view tag, const char* name) {
    const std::string id(attribute_of(tag, name).value_or(""));
    return id.substr(id.rfind('#', 0) == 0 ? 1 : 0);
  }

  void read_tag(std::string_view tag, std::size_t end) {
    const std::string name(tag.substr(1, tag.find_first_of(" \t\r\n/>", 2) - 1));
    const double count = number_of(tag, "count", static_cast<double>(text_.size()), 0);
    const double stride = number_of(tag, "stride", kMaxStride, 1);
    const double offset = number_of(tag, "offset", static_cast<double>(text_.size()), 0);
    number_of(tag, "set", kMaxStride, 0);
    if (name == "source") source_ = id_of(tag, "id");
    if (name.ends_with("_array")) {
      const auto [array, added] = arrays_.try_emplace(id_of(tag, "id"), count);
      array->second = std::min(array->second, count);
    }
    if (name == "accessor") accessors_[source_].push_back({id_of(tag, "source"), count, stride, offset, 0});
    if (name == "param" && !accessors_[source_].empty()) ++accessors_[source_].back().params;
    if (name == "input" && offset > kMaxStride)
      fail_at(where_, "an input of the Collada file has the offset {}", offset);
    if (name == "skin") skins_.emplace_back();
    if (name == "input" && !skins_.empty()) read_skin_input(tag);
    if ((name == "p" || name == "v" || name == "vcount" || name == "h") && tag.back() != '/') read_indices(name, end);
  }

  void read_skin_input(std::string_view tag) {
    const std::string meaning = id_of(tag, "semantic");
    if (meaning == "JOINT" && skins_.back().joints.empty()) skins_.back().joints = id_of(tag, "source");
    if (meaning == "INV_BIND_MATRIX") skins_.back().matrices = id_of(tag, "source");
    if (meaning == "WEIGHT") skins_.back().weights = id_of(tag, "source");
  }

  /// Assimp reads for ever when it meets something that is no number. It takes `v` as pairs of a joint and a weight.
  void read_indices(const std::string& name, std::size_t end) {
    const std::size_t stop = std::min(text_.find("</", end), text_.size());
    const std::size_t wrong = text_.find_first_not_of("0123456789+- \t\r\n", end + 1);
    if (wrong < stop)
      fail_at(where_, "a list of indices <{}> of the Collada file holds the byte {}, which is no digit", name,
              static_cast<int>(static_cast<unsigned char>(text_[wrong])));
    if (name != "v" || skins_.empty()) return;
    std::size_t item = 0;
    for (std::size_t at = end + 1; at < stop; ++item) {
      const std::size_t begin = std::min(text_.find_first_not_of(" \t\r\n", at), stop);
      at = std::min(text_.find_first_of(" \t\r\n", begin), stop);
      const auto number = parse_number(std::string_view(text_).substr(begin, at - begin));
      double& largest = skins_.back().largest[item % 2];
      if (number) largest = std::max(largest, *number < 0 ? 4294967295.0 + *number : *number);
    }
  }

  void check_accessors() const {
    for (const auto& [source, accessors] : accessors_)
      for (const Accessor& accessor : accessors) {
        const auto array = arrays_.find(accessor.array);
        const double width = std::max<double>(accessor.stride, accessor.params);
        const double needed = accessor.count > 0 ? accessor.offset + (accessor.count - 1) * accessor.stride + width : 0;
        if (array != arrays_.end() && needed > array->second)
          fail_at(where_, "the source '{}' of the Collada file needs {} values, but its array has {}", source, needed,
                  array->second);
      }
  }

  /// The rows of a source; of several, the fewest.
  double rows_of(const std::string& source) const {
    const auto found = accessors_.find(source);
    if (found == accessors_.end() || found->second.empty()) return 0;
    double rows = found->second[0].count;
    for (const Accessor& accessor : found->second) rows = std::min(rows, accessor.count);
    return rows;
  }

  void check_skin(const Skin& skin) const {
    const double joints = rows_of(skin.joints), weights = rows_of(skin.weights);
    if (skin.largest[0] >= joints || skin.largest[1] >= weights)
      fail_at(where_, "a skin of the Collada file names joint {} and weight {}, but it has {} and {}", skin.largest[0],
              skin.largest[1], joints, weights);
    const auto matrices = accessors_.find(skin.matrices);
    const double stride = matrices == accessors_.end() || matrices->second.empty() ? 0 : matrices->second[0].stride;
    if (joints > 0 && (rows_of(skin.matrices) < joints || stride < 16))
      fail_at(where_, "a skin of the Collada file has {} joints, but {} inverse bind matrices of {} numbers", joints,
              rows_of(skin.matrices), stride);
  }

  FileLocation where_;
  const std::string& text_;
  std::string source_;                    ///< id of the source in work
  std::map<std::string, double> arrays_;  ///< values of each
  std::map<std::string, std::vector<Accessor>> accessors_;
  std::vector<Skin> skins_;
};

}  // namespace

void refuse_what_assimp_trusts(const std::filesystem::path& path, const std::string& text) {
  ColladaGuard(path, text).check();
}

ColladaAsset collada_asset(const std::string& text) {
  ColladaAsset asset;
  bool unit = false, axis = false;
  for (std::size_t at = text.find('<'); at != std::string::npos && !(unit && axis); at = text.find('<', at)) {
    const std::size_t end = end_of_tag(text, at);
    if (end == std::string::npos) break;
    const std::string_view tag = std::string_view(text).substr(at, end - at);
    if (!unit && (tag.starts_with("<unit ") || tag.starts_with("<unit\t") || tag.starts_with("<unit\n"))) {
      const auto metres = parse_number(attribute_of(tag, "meter").value_or("1"));
      if (metres && *metres > 0 && std::isfinite(*metres)) asset.metres_per_unit = *metres;
      unit = true;
    }
    if (!axis && tag.starts_with("<up_axis")) {
      const std::size_t letter = text.find_first_of("XYZ", end);
      if (letter != std::string::npos && text.compare(letter + 1, 3, "_UP") == 0)
        asset.up = static_cast<char>(text[letter] - 'X' + 'x');
      axis = true;
    }
    at = end;
  }
  return asset;
}

}  // namespace doppel
