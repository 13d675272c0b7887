#include "doppel/core/shard.h"

#include <charconv>
#include <optional>

#include "doppel/core/error.h"

namespace doppel {

namespace {

/// A number of decimal digits only.
std::optional<int> whole_number(const std::string& text) {
  int number = -1;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stop != end || number < 0) return std::nullopt;
  return number;
}

}  // namespace

Shard parse_shard(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto index = whole_number(text.substr(0, slash));
  const auto count = slash == std::string::npos ? std::nullopt : whole_number(text.substr(slash + 1));
  if (!index || !count)
    fail<UsageError>("--shard {}: expected i/n, two whole numbers, e.g. 0/4 for the first of four shards", text);
  if (*count < 1 || *count > kMaxShards)
    fail<UsageError>("--shard {}: the number of shards must be from 1 to {}", text, kMaxShards);
  if (*index >= *count)
    fail<UsageError>("--shard {}: shards count from 0, so the first number must be from 0 to {}", text, *count - 1);
  return {*index, *count};
}

}  // namespace doppel
