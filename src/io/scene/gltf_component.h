#pragma once

#include <cstddef>
#include <string>

namespace doppel {

/// Numbers of glTF's binary data. The types of components are those of the specification: 5120 and 5121 are signed and
/// unsigned bytes, 5122 and 5123 short integers, 5125 unsigned integers, 5126 float.

/// Bytes of a component; 0 for a type that is none.
std::size_t component_size(int type);
/// @param bytes component_size(type) of them, in any alignment
/// @param normalized an integer stands for -1..1, or for 0..1 where it is unsigned
double component_value(const char* bytes, int type, bool normalized);
/// Components of an element such as `VEC3`; 0 for an unknown word.
std::size_t width_of_type(const std::string& type);

}  // namespace doppel
