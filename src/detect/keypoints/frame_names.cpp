#include "doppel/detect/keypoints/frame_names.h"

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <set>

#include "doppel/core/as_size.h"

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

NumberedNames number_names(const std::vector<std::string>& names) {
  NumberedNames result;
  std::set<long> numbers;
  for (const std::string& name : names) {
    const std::optional<long> number = number_in_name(name);
    if (!number || !numbers.insert(*number).second) break;
    result.frames.push_back(*number);
  }
  if (result.frames.size() == names.size()) return result;
  std::vector<std::size_t> order(names.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return natural_less(names[a], names[b]); });
  result = {std::vector<long>(names.size()), true};
  for (std::size_t rank = 0; rank < order.size(); ++rank) result.frames[order[rank]] = static_cast<long>(rank);
  return result;
}

}  // namespace doppel
