#include "doppel/detect/keypoints/json_parts.h"

#include <algorithm>
#include <array>
#include <climits>
#include <cmath>

#include "doppel/core/atomic_file.h"
#include "doppel/core/json_bounds.h"

namespace doppel {

namespace {

using nlohmann::json;

constexpr std::size_t kMaxJsonDepth = 100;
constexpr std::uintmax_t kMaxJsonBytes = std::uintmax_t{1} << 30;
constexpr double kMaxJsonGigabytes = 4.0;  // of the parsed file
constexpr double kMaxCoordinate = 1e7;

/// The token of Python at a position of a JSON text, or nothing.
std::string_view token_of_python(std::string_view text, std::size_t at) {
  for (const std::string_view token : {"NaN", "-Infinity", "Infinity"})
    if (text.substr(at, token.size()) == token) return token;
  return {};
}

/// The text with null for the tokens NaN, Infinity and -Infinity outside of strings.
std::string without_tokens_of_python(std::string_view text) {
  std::string result;
  result.reserve(text.size() + text.size() / 8);
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::string_view token = in_string ? std::string_view() : token_of_python(text, i);
    if (!token.empty()) {
      result += "null";
      i += token.size() - 1;
      continue;
    }
    result += text[i];
    if (text[i] == '"') in_string = !in_string;
    if (in_string && text[i] == '\\' && i + 1 < text.size()) result += text[++i];
  }
  return result;
}

int line_of_byte(const std::string& text, std::size_t byte) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(byte, text.size()));
  return 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
}

/// Nothing for null.
std::optional<double> coordinate(const json& value, const FileLocation& where) {
  if (value.is_null()) return std::nullopt;
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!(std::abs(number) <= kMaxCoordinate))
    fail_at(where, "reading keypoints: found '{}' where a number of a person's keypoints is expected",
            value.dump(-1, ' ', false, json::error_handler_t::replace).substr(0, 40));
  return number;
}

Keypoint point_of_json(const json& x, const json& y, const json& confidence, const FileLocation& where,
                       ThirdNumber third = ThirdNumber::confidence) {
  const auto px = coordinate(x, where), py = coordinate(y, where), c = coordinate(confidence, where);
  if (!px || !py || !c) return {};
  return keypoint_of(*px, *py, third == ThirdNumber::visibility ? 0.5 * *c : *c);
}

void require_scores(const json& list, const json* scores, const FileLocation& where) {
  if (scores && (!scores->is_array() || scores->size() != list.size()))
    fail_at(where, "reading keypoints: a person has {} points, but `keypoint_scores` is not a list of that length",
            list.size());
}

}  // namespace

std::shared_ptr<const json> parse_keypoint_json(const std::filesystem::path& path) {
  std::string text = read_file(path, kMaxJsonBytes);
  if (is_json_deeper_than(text, kMaxJsonDepth))
    fail_at({path.string(), 0}, "reading keypoints: lists and objects are nested more than {} deep", kMaxJsonDepth);
  if (const double gigabytes = static_cast<double>(json_memory(text)) / 1e9; gigabytes > kMaxJsonGigabytes)
    fail_at(
        {path.string(), 0},
        "reading keypoints: parsing this file takes up to {:.1f} GB of memory, allowed are {:.0f}; write a file for "
        "each camera, or for fewer frames",
        gigabytes, kMaxJsonGigabytes);
  for (const bool again : {false, true}) {
    try {
      return std::make_shared<const json>(json::parse(text));
    } catch (const json::exception& e) {
      const bool of_python = text.find("NaN") != std::string::npos || text.find("Infinity") != std::string::npos;
      if (!again && of_python) {
        text = without_tokens_of_python(text);
        continue;
      }
      const auto* fault = dynamic_cast<const json::parse_error*>(&e);
      fail_at({path.string(), fault ? line_of_byte(text, fault->byte) : 0},
              "reading keypoints: this is not JSON; the file may be truncated");
    }
  }
  return nullptr;
}

const json* find_key(const json& object, std::initializer_list<const char*> keys) {
  if (!object.is_object()) return nullptr;
  for (const char* key : keys)
    if (const auto found = object.find(key); found != object.end()) return &*found;
  return nullptr;
}

Keypoint keypoint_of(double x, double y, double confidence) {
  if (!(confidence > 0.0) || !std::isfinite(x) || !std::isfinite(y)) return {};
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(std::min(confidence, 1.0))};
}

Person flat_points(const json& list, const FileLocation& where, ThirdNumber third) {
  if (!list.is_array()) fail_at(where, "reading keypoints: the keypoints of a person are not a list");
  if (list.size() % 3 != 0)
    fail_at(where, "reading keypoints: a person has {} numbers; x, y and confidence of each point are expected",
            list.size());
  Person person;
  for (std::size_t i = 0; i < list.size(); i += 3)
    person.push_back(point_of_json(list[i], list[i + 1], list[i + 2], where, third));
  return person;
}

Person nested_points(const json& list, const json* scores, const FileLocation& where) {
  require_scores(list, scores, where);
  Person person;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const json& point = list[i];
    if (!point.is_array() || point.size() < 2 || (point.size() < 3 && !scores))
      fail_at(where,
              "reading keypoints: point {} of a person is not of the form [x, y] with a confidence in "
              "`keypoint_scores`",
              i);
    if (scores && point.size() > 2)
      fail_at(where,
              "reading keypoints: the points have {} coordinates and so are points in space; points in the image "
              "are needed: run the detector without its 3D lifter",
              point.size());
    person.push_back(point_of_json(point[0], point[1], scores ? (*scores)[i] : point[2], where));
  }
  return person;
}

Person points_of_person(const json& list, const json* scores, const FileLocation& where) {
  const bool nested = list.is_array() && !list.empty() && list[0].is_array();
  return nested ? nested_points(list, scores, where) : flat_points(list, where);
}

std::optional<long> json_frame(const json* value) {
  if (!value || !value->is_number_integer()) return std::nullopt;
  if (value->is_number_unsigned() && value->get<std::uint64_t>() > INT_MAX) return std::nullopt;
  const auto number = value->get<std::int64_t>();
  return number >= 0 && number <= INT_MAX ? std::optional(static_cast<long>(number)) : std::nullopt;
}

std::vector<std::string> json_names(const json* value) {
  std::vector<std::string> names;
  if (!value || !value->is_structured()) return names;
  names.resize(value->size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string key = std::to_string(i);
    const json* name = value->is_array() ? &(*value)[i] : find_key(*value, {key.c_str()});
    if (!name || !name->is_string()) return {};
    names[i] = name->get<std::string>();
  }
  return names;
}

}  // namespace doppel
