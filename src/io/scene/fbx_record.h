#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace doppel {

/// A value of an FBX record: a number, text or raw bytes, or an array of numbers.
using FbxValue = std::variant<std::int64_t, double, std::string, std::vector<double>, std::vector<std::int64_t>>;

/// A record of an FBX file: `Vertices: *9 { a: ... }`.
struct FbxRecord {
  std::string name;
  std::vector<FbxValue> values;
  std::vector<FbxRecord> children;

  const FbxRecord* child(const char* wanted) const;
  /// Value `i` as a number, text or array; the fallback, or an empty one, where it is something else or missing.
  double number(std::size_t i, double fallback = 0.0) const;
  std::int64_t integer(std::size_t i, std::int64_t fallback = 0) const;
  std::string text(std::size_t i) const;
  std::vector<double> numbers() const;         ///< the array in the first value
  std::vector<std::int64_t> integers() const;  ///< the array in the first value
};

}  // namespace doppel
