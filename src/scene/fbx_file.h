#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "doppel/scene/read_scene.h"

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

/// Reads the records of an FBX file of version 7, binary or text. @return the root, whose children are the records
/// @throws FileError: truncated, another version, lengths that the file does not have
FbxRecord read_fbx_records(const std::filesystem::path& path, const SceneLimits& limits);

/// The objects of an FBX file and their connections.
class FbxObjects {
 public:
  struct Connection {
    std::int64_t other = 0;
    std::string property;  ///< `Lcl Rotation`, `DiffuseColor`, ... or empty
  };

  explicit FbxObjects(const FbxRecord& root);

  /// All objects of a class (`Model`, `Geometry`, `Deformer`, ...) in the order of the file.
  std::vector<const FbxRecord*> all(const char* kind) const;
  const FbxRecord* find(std::int64_t id) const;
  /// What is connected below, or above, an object, in the order of the file. @param kind a class, or null for all
  std::vector<const FbxRecord*> below(const FbxRecord& object, const char* kind, const char* property = nullptr) const;
  std::vector<const FbxRecord*> above(const FbxRecord& object, const char* kind) const;
  std::vector<std::pair<const FbxRecord*, std::string>> above_with_property(const FbxRecord& object,
                                                                            const char* kind) const;

 private:
  std::vector<const FbxRecord*> objects_;
  std::map<std::int64_t, const FbxRecord*> by_id_;
  std::map<std::int64_t, std::vector<Connection>> below_, above_;
};

/// The name of an object: `Hips` of `Hips\0\1Model` or `Model::Hips`.
std::string fbx_name(const FbxRecord& object);
/// The values of a property in `Properties70`; null when the object does not have it.
const FbxRecord* fbx_property(const FbxRecord& object, const char* name);
double fbx_number(const FbxRecord& object, const char* property, double fallback);

}  // namespace doppel
