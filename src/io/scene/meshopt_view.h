#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace doppel {

/// A buffer view that meshoptimizer has compressed: what EXT_meshopt_compression says of it. Nothing in it is trusted.
struct MeshoptView {
  std::string_view stream;                  ///< compressed bytes
  std::size_t count = 0;                    ///< elements
  std::size_t stride = 0;                   ///< bytes of an element
  std::string mode;                         ///< ATTRIBUTES, TRIANGLES or INDICES
  std::string filter = "NONE";              ///< or OCTAHEDRAL, QUATERNION, EXPONENTIAL
  std::size_t max_bytes = std::size_t(-1);  ///< of count * stride
};

/// The bytes of a view, or why there are none.
struct UnpackedView {
  std::string bytes;  ///< count * stride of them
  std::string fault;  ///< continues a sentence that begins with the name of the view; empty when all is well
};

/// Decodes a view. Memory: count * stride, which is at most 64 times the compressed bytes, as no stream holds more.
UnpackedView unpack_meshopt(const MeshoptView& view);

}  // namespace doppel
