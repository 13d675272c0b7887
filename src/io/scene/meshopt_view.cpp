#include "doppel/io/scene/meshopt_view.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include "doppel/core/excerpt.h"

namespace doppel {

namespace {

/// Each element of a block takes at least two bits for 16 of its bytes, and an index at least a byte for three.
constexpr std::size_t kMaxExpansion = 64;
constexpr std::size_t kMaxMeshoptStride = 256;
/// The high half of a stream's first byte names its codec, the low half the version.
constexpr unsigned char kVertexMark = 0xA0, kVersionBits = 0x0F;

const char* const kRepack = "write the file anew, e.g. by `gltfpack -c`, or without compression";

/// The library checks the stream, but only asserts what the caller says of it.
std::string fault_of_layout(const MeshoptView& view) {
  const bool attributes = view.mode == "ATTRIBUTES", triangles = view.mode == "TRIANGLES";
  if (!attributes && !triangles && view.mode != "INDICES")
    return fmt::format("has the mode '{}' of meshopt compression, allowed are ATTRIBUTES, TRIANGLES and INDICES",
                       excerpt(view.mode, 40));
  if (attributes && (view.stride == 0 || view.stride > kMaxMeshoptStride || view.stride % 4 != 0))
    return fmt::format("has elements of {} bytes; meshopt compression allows multiples of 4 up to {}", view.stride,
                       kMaxMeshoptStride);
  if (!attributes && view.stride != 2 && view.stride != 4)
    return fmt::format("has indices of {} bytes; meshopt compression allows 2 or 4", view.stride);
  if (triangles && view.count % 3 != 0) return fmt::format("has {} corners of triangles, not three each", view.count);
  const double bytes = static_cast<double>(view.count) * static_cast<double>(view.stride);
  if (bytes > static_cast<double>(kMaxExpansion * view.stream.size()))
    return fmt::format("announces {} bytes, more than {} compressed ones can hold: the file is truncated or damaged",
                       bytes, view.stream.size());
  if (bytes > static_cast<double>(view.max_bytes))
    return fmt::format("announces {} bytes; with those before it, that is more than is read", bytes);
  return {};
}

std::string fault_of_filter(const MeshoptView& view) {
  if (view.filter == "NONE" || view.filter.empty()) return {};
  const bool octahedral = view.filter == "OCTAHEDRAL", quaternion = view.filter == "QUATERNION";
  if (!octahedral && !quaternion && view.filter != "EXPONENTIAL")
    return fmt::format("has the filter '{}' of meshopt compression, which is not read; {}", excerpt(view.filter, 40),
                       kRepack);
  if (view.mode != "ATTRIBUTES") return fmt::format("has a filter in the mode {}, which has none", view.mode);
  if ((octahedral && view.stride != 4 && view.stride != 8) || (quaternion && view.stride != 8))
    return fmt::format("has elements of {} bytes, which the filter {} does not know", view.stride, view.filter);
  return {};
}

bool decode_meshopt(const MeshoptView& view, std::string& bytes) {
  const auto* stream = reinterpret_cast<const unsigned char*>(view.stream.data());
  const std::size_t size = view.stream.size();
  if (view.mode == "ATTRIBUTES")
    return meshopt_decodeVertexBuffer(bytes.data(), view.count, view.stride, stream, size) == 0;
  if (view.mode == "TRIANGLES")
    return meshopt_decodeIndexBuffer(bytes.data(), view.count, view.stride, stream, size) == 0;
  return meshopt_decodeIndexSequence(bytes.data(), view.count, view.stride, stream, size) == 0;
}

void apply_filter(const MeshoptView& view, std::string& bytes) {
  if (view.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(bytes.data(), view.count, view.stride);
  if (view.filter == "QUATERNION") meshopt_decodeFilterQuat(bytes.data(), view.count, view.stride);
  if (view.filter == "EXPONENTIAL") meshopt_decodeFilterExp(bytes.data(), view.count, view.stride);
}

/// A newer version of the codec, of which the extension with the prefix KHR allows the use.
int newer_version(const MeshoptView& view) {
  if (view.mode != "ATTRIBUTES" || view.stream.empty()) return 0;
  const auto mark = static_cast<unsigned char>(view.stream[0]);
  return (mark & ~kVersionBits) == kVertexMark ? mark & kVersionBits : 0;
}

}  // namespace

UnpackedView unpack_meshopt(const MeshoptView& view) {
  UnpackedView result;
  result.fault = fault_of_layout(view);
  if (result.fault.empty()) result.fault = fault_of_filter(view);
  if (!result.fault.empty() || view.count == 0) return result;
  result.bytes.resize(view.count * view.stride);
  if (decode_meshopt(view, result.bytes)) {
    apply_filter(view, result.bytes);
    return result;
  }
  result.bytes.clear();
  const int version = newer_version(view);
  result.fault =
      version > 0 ? fmt::format("is compressed by version {} of meshopt's codec, of which version 0 is read; {}",
                                version, "write the file anew by `gltfpack -c -ce ext`, or without compression")
                  : fmt::format("has {} compressed bytes that meshopt cannot decode: the file is truncated or damaged",
                                view.stream.size());
  return result;
}

}  // namespace doppel
