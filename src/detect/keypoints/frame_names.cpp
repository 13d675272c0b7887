#include "doppel/detect/keypoints/frame_names.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <regex>
#include <set>

namespace doppel {

namespace {

bool is_digit_of_name(char c) { return c >= '0' && c <= '9'; }

/// The digits from `i` on, without leading zeros; moves `i` behind them.
std::string take_digits(std::string_view name, std::size_t& i) {
  std::string digits;
  for (; i < name.size() && is_digit_of_name(name[i]); ++i)
    if (name[i] != '0' || !digits.empty()) digits += name[i];
  return digits;
}

constexpr long kMaxFrameNumber = 999'999'999;                       ///< more is a time: half a year of video
constexpr double kMinFrameSeconds = 5e-4, kMaxFrameSeconds = 10.0;  ///< seconds between images that a name may count in

/// A name without folder and extension, cut at its numbers: text, number, ..., text.
struct CutName {
  std::vector<std::string> texts;    ///< [n + 1]
  std::vector<std::string> numbers;  ///< [n] digits

  explicit CutName(const std::string& name) : texts(1) {
    for (const char c : std::filesystem::path(name).stem().string()) {
      if (!is_digit_of_name(c)) {
        if (numbers.size() == texts.size()) texts.emplace_back();
        texts.back() += c;
        continue;
      }
      if (numbers.size() < texts.size()) numbers.emplace_back();
      numbers.back() += c;
    }
    if (numbers.size() == texts.size()) texts.emplace_back();
  }
  /// Whether the last number is the fraction of the one before: 9.755.
  bool has_fraction() const {
    const std::size_t n = numbers.size();
    return n >= 2 && texts.back().empty() && (texts[n - 1] == "." || texts[n - 1] == ",");
  }
};

std::vector<CutName> cut_names(const std::vector<std::string>& names) { return {names.begin(), names.end()}; }

/// How many of the numbers differ between names that are alike otherwise; 0: the names differ in more.
std::size_t varying_numbers(const std::vector<CutName>& names) {
  std::size_t varying = 0;
  for (std::size_t column = 0; column < names.front().numbers.size(); ++column) {
    std::set<std::string> values;
    for (const CutName& name : names) {
      if (name.texts != names.front().texts) return 0;
      values.insert(name.numbers[column]);
    }
    varying += values.size() > 1;
  }
  return varying;
}

/// The names that are alike but for their numbers, of several such groups the largest. Some programs leave out a
/// fraction of a second that is 0.
std::vector<std::string> most_alike(const std::vector<std::string>& names) {
  std::map<std::vector<std::string>, std::vector<std::string>> alike;
  for (const std::string& name : names) alike[CutName(name).texts].push_back(name);
  const auto most = std::max_element(alike.begin(), alike.end(),
                                     [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  return most == alike.end() ? std::vector<std::string>() : most->second;
}

/// Whether a date and a time stand before the last number: 2024-05-06T07_08_09, 20240506_070809, or the seconds since
/// 1970.
bool is_dated(const CutName& name) {
  std::string digits;
  for (std::size_t i = 0; i + 1 < name.numbers.size(); ++i) digits += name.numbers[i];
  static const std::regex time(R"((19|20)\d\d(0[1-9]|1[0-2])([0-2]\d|3[01])([01]\d|2[0-3])[0-5]\d[0-5]\d$)");
  return std::regex_search(digits, time) || (name.has_fraction() && name.numbers[name.numbers.size() - 2].size() == 10);
}

/// The smallest distance of two numbers that follow each other; 0 for fewer than two.
long smallest_step(std::vector<long> numbers) {
  std::sort(numbers.begin(), numbers.end());
  long least = 0;
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    const long step = numbers[i] - numbers[i - 1];
    least = i == 1 ? step : std::min(least, step);
  }
  return least;
}

/// Whether the numbers at the ends of names, in the order of the names, go on one by one, perhaps with gaps.
bool go_on(const std::vector<long>& numbers) {
  return std::is_sorted(numbers.begin(), numbers.end()) && smallest_step(numbers) == 1;
}

/// Whether the last numbers of names with date and time are parts of a second, by their digits and their steps.
bool are_fractions(const std::vector<CutName>& names, const std::vector<long>& numbers) {
  const std::size_t digits = names.front().numbers.back().size();
  if (!std::all_of(names.begin(), names.end(), is_dated)) return false;
  if (std::all_of(names.begin(), names.end(), [](const CutName& name) { return name.has_fraction(); })) return true;
  const bool same = std::all_of(names.begin(), names.end(),
                                [&](const CutName& name) { return name.numbers.back().size() == digits; });
  if (!same || (digits != 2 && digits != 3 && digits != 6 && digits != 9)) return false;
  const double step = static_cast<double>(smallest_step(numbers)) / std::pow(10.0, static_cast<double>(digits));
  return smallest_step(numbers) > 1 && step >= kMinFrameSeconds && step <= kMaxFrameSeconds;
}

}  // namespace

std::optional<long> number_in_name(const std::string& name) {
  const std::string stem = std::filesystem::path(name).stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !is_digit_of_name(stem[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit_of_name(stem[begin - 1])) --begin;
  if (begin == end || end - begin > 15) return std::nullopt;
  return std::stol(stem.substr(begin, end - begin));
}

bool natural_less(std::string_view a, std::string_view b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit_of_name(a[i]) && is_digit_of_name(b[j])) {
      const std::string x = take_digits(a, i), y = take_digits(b, j);
      if (x != y) return x.size() != y.size() ? x.size() < y.size() : x < y;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  const std::size_t rest_of_a = a.size() - i, rest_of_b = b.size() - j;
  return rest_of_a != rest_of_b ? rest_of_a < rest_of_b : a < b;
}

bool hold_times(const std::vector<std::string>& all) {
  const std::vector<std::string> names = most_alike(all);
  if (names.size() < 2 || 2 * names.size() <= all.size()) return false;
  const std::vector<CutName> cut = cut_names(names);
  std::vector<long> numbers;
  for (const std::size_t i : order_of_names(names)) {
    if (cut[i].numbers.empty()) return false;
    const std::string& last = cut[i].numbers.back();
    const std::optional<long> number = number_in_name(last);
    if (!number || *number > kMaxFrameNumber) return true;
    numbers.push_back(*number);
  }
  if (go_on(numbers)) return false;
  return varying_numbers(cut) > 1 || are_fractions(cut, numbers);
}

bool are_dated(const std::vector<std::string>& names) {
  return std::all_of(names.begin(), names.end(), [](const std::string& name) { return is_dated(CutName(name)); });
}

std::vector<std::size_t> order_of_names(const std::vector<std::string>& names) {
  const std::vector<CutName> cut = cut_names(names);
  std::size_t longest = 0;
  for (const CutName& name : cut) longest = std::max(longest, name.has_fraction() ? name.numbers.back().size() : 0);
  std::set<std::string> whole;  // parts of the numbers before their points
  bool dated = false;
  for (const CutName& name : cut) {
    if (!name.has_fraction()) continue;
    whole.insert(name.numbers[name.numbers.size() - 2]);
    dated |= is_dated(name);
  }
  const bool seconds = whole.size() > 1 || dated;
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < names.size(); ++i) {
    keys.push_back((std::filesystem::path(names[i]).parent_path() / std::filesystem::path(names[i]).stem()).string());
    if (seconds && cut[i].has_fraction()) keys.back().append(longest - cut[i].numbers.back().size(), '0');
  }
  std::vector<std::size_t> order(names.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return keys[a] != keys[b] ? natural_less(keys[a], keys[b]) : natural_less(names[a], names[b]);
  });
  return order;
}

NumberedNames number_names(const std::vector<std::string>& names) {
  NumberedNames result;
  std::set<long> numbers;
  for (const std::string& name : names) {
    const std::optional<long> number = number_in_name(name);
    if (!number || !numbers.insert(*number).second) break;
    result.frames.push_back(*number);
  }
  if (result.frames.size() == names.size() && !hold_times(names)) return result;
  const std::vector<std::size_t> order = order_of_names(names);
  result = {std::vector<long>(names.size()), true};
  for (std::size_t rank = 0; rank < order.size(); ++rank) result.frames[order[rank]] = static_cast<long>(rank);
  return result;
}

}  // namespace doppel
