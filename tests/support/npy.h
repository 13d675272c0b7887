#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/core/npy.h"

/// Reading the arrays that tests hold their results against.
namespace doppel {

/// An array as doubles, with its shape.
struct DoubleArray {
  std::vector<std::int64_t> shape;
  std::vector<double> values;
  double at(std::int64_t i) const { return values.at(static_cast<std::size_t>(i)); }
};

/// @throws FileError as read_npy does
inline DoubleArray read_doubles(const std::filesystem::path& path) {
  const NpyArray array = read_npy(path);
  return {array.shape, array.as<double>()};
}

/// An array of integers. @throws Error when it holds floating-point numbers
inline std::vector<int> read_ints(const std::filesystem::path& path) { return read_npy(path).as<int>(); }

}  // namespace doppel
