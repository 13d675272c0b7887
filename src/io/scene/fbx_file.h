#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/io/scene/fbx_record.h"
#include "doppel/io/scene/scene_limits.h"

namespace doppel {

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
/// A property that is a choice of 0 .. `largest`; the fallback for anything else.
int fbx_choice(const FbxRecord& object, const char* property, int fallback, int largest);

}  // namespace doppel
