#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace doppel {

/// Raw bytes in a record, such as an image.
struct FbxBytes {
  std::string bytes;
};

/// A record of an FBX file to write: a name, values of the types that the format has, and inner records. `FbxRecord`
/// (io/scene) is what the reader makes of it, without the widths of the numbers.
struct FbxNode {
  using Value = std::variant<std::int32_t, std::int64_t, double, std::string, FbxBytes, std::vector<float>,
                             std::vector<double>, std::vector<std::int32_t>, std::vector<std::int64_t>>;
  std::string name;  ///< at most 255 bytes
  std::vector<Value> values;
  std::vector<FbxNode> children;
};

/// The name of an object with its kind, as binary files state it: `Hips\0\1Model`. The text form has `Model::Hips`.
std::string fbx_object_name(const std::string& name, const std::string& kind);

/// The binary form of FBX. The same records give the same bytes.
/// @param root its children are the records of the file
/// @param version 7400 (7.4, lengths of 32 bits) or 7500 (7.5, 64 bits)
/// @param compressed deflates the arrays
/// @throws Error when a file of version 7400 would be larger than 4 GB
std::string fbx_binary(const FbxNode& root, int version, bool compressed);

}  // namespace doppel
