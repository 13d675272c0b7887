#include "fuzz/mutator.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace doppel::fuzz {

namespace {

constexpr std::size_t kMaxBytes = 1 << 20, kMaxChanges = 6;
constexpr std::array<std::uint64_t, 14> kEdges{
    0,      1,          2,          0x7F,       0x80,       0xFF,       0x7FFF,
    0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x10000001, 0x7FC00000, ~std::uint64_t{0}};
constexpr std::array<const char*, 16> kNumbers{
    "0",   "-1",  "1",   "2147483647", "2147483648", "4294967295",           "1e308", "-1e39", "1e-320",
    "nan", "inf", "0.5", "99999999",   "-0",         "18446744073709551616", "1e999"};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

std::string Mutator::next() {
  std::string bytes = any_seed();
  const bool inside = target_.unwrap && below(2) == 0;
  for (std::size_t changes = 1 + below(kMaxChanges); changes > 0; --changes)
    inside ? change_inside(bytes) : change(bytes);
  if (bytes.size() > kMaxBytes) bytes.resize(kMaxBytes);
  return bytes;
}

void Mutator::change(std::string& bytes) {
  const std::size_t kind = below(12);
  if (kind < 4) return change_bytes(bytes, kind);
  if (kind < 7) return change_number(bytes);
  change_part(bytes, kind);
}

void Mutator::change_inside(std::string& bytes) {
  std::optional<Unwrapped> file = target_.unwrap(bytes);
  if (!file) return change(bytes);
  change(file->parts[below(file->parts.size())]);
  bytes = file->wrap(file->parts);
}

void Mutator::change_bytes(std::string& bytes, std::size_t kind) {
  if (bytes.empty()) return;
  const std::size_t at = below(bytes.size());
  if (kind == 0) {
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
  } else if (kind == 1) {
    bytes[at] = static_cast<char>(below(256));
  } else {
    const std::uint64_t edge = kEdges[below(kEdges.size())];
    const std::size_t width = std::min(std::size_t{1} << below(4), bytes.size() - at);
    std::memcpy(bytes.data() + at, &edge, width);
  }
}

/// Replaces a number that stands in the file as text.
void Mutator::change_number(std::string& bytes) {
  if (bytes.empty()) return;
  std::size_t begin = below(bytes.size());
  while (begin < bytes.size() && !is_digit(bytes[begin])) ++begin;
  if (begin == bytes.size()) return;
  while (begin > 0 && is_digit(bytes[begin - 1])) --begin;
  std::size_t end = begin;
  while (end < bytes.size() && (is_digit(bytes[end]) || bytes[end] == '.')) ++end;
  bytes.replace(begin, end - begin, kNumbers[below(kNumbers.size())]);
}

void Mutator::change_part(std::string& bytes, std::size_t kind) {
  const std::size_t at = below(bytes.size() + 1), length = below(std::min<std::size_t>(bytes.size() - at, 200) + 1);
  if (kind == 7) {
    bytes.erase(at, length);
  } else if (kind == 8) {
    bytes.resize(at);
  } else if (kind == 9) {
    const std::string part = bytes.substr(at, length);
    const std::size_t times = below(10) == 0 ? below(4000) : below(4);
    for (std::size_t i = 0; i < times && bytes.size() < kMaxBytes; ++i) bytes.insert(at, part);
  } else if (kind == 10) {
    const std::string& other = any_seed();
    const std::size_t from = below(other.size() + 1);
    bytes.replace(at, length, other.substr(from, below(std::min<std::size_t>(other.size() - from, 400) + 1)));
  } else if (const auto& words = target_.dictionary; !words.empty()) {
    bytes.replace(at, below(3) == 0 ? length : 0, words[below(words.size())]);
  }
}

}  // namespace doppel::fuzz
