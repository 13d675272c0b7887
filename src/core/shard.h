#pragma once

#include <cstddef>
#include <string>

namespace doppel {

/// One part of a command's work, for one of several machines. The work consists of numbered units (cameras of a
/// sequence, or sequences). Unit k belongs to shard k mod `count`.
struct Shard {
  int index = 0, count = 1;

  bool owns(std::size_t unit) const {
    return unit % static_cast<std::size_t>(count) == static_cast<std::size_t>(index);
  }
  std::string to_string() const { return std::to_string(index) + "/" + std::to_string(count); }
  bool operator==(const Shard&) const = default;
};

inline constexpr int kMaxShards = 100000;

/// Reads "i/n" with 0 <= i < n <= kMaxShards. @throws UsageError for anything else
Shard parse_shard(const std::string& text);

}  // namespace doppel
