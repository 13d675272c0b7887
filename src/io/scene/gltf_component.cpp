#include "doppel/io/scene/gltf_component.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>

namespace doppel {

namespace {

template <typename T>
double component_as(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

}  // namespace

std::size_t component_size(int type) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      return 0;
  }
}

double component_value(const char* bytes, int type, bool normalized) {
  switch (type) {
    case 5120:
      return normalized ? std::max(component_as<std::int8_t>(bytes) / 127, -1.0) : component_as<std::int8_t>(bytes);
    case 5121:
      return component_as<std::uint8_t>(bytes) / (normalized ? 255 : 1);
    case 5122:
      return normalized ? std::max(component_as<std::int16_t>(bytes) / 32767, -1.0) : component_as<std::int16_t>(bytes);
    case 5123:
      return component_as<std::uint16_t>(bytes) / (normalized ? 65535 : 1);
    case 5125:
      return component_as<std::uint32_t>(bytes);
    default:
      return component_as<float>(bytes);
  }
}

std::size_t width_of_type(const std::string& type) {
  static const std::pair<const char*, std::size_t> kWidths[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                                                                {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
  for (const auto& [name, width] : kWidths)
    if (type == name) return width;
  return 0;
}

}  // namespace doppel
