#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"

namespace doppel {

/// The numbers of an accessor: `count` rows of `width` values, normalised integers already divided.
struct GltfNumbers {
  std::size_t count = 0, width = 0;
  std::vector<double> values;

  const double* row(std::size_t i) const { return values.data() + i * width; }
};

/// A glTF 2.0 file: its JSON and its buffers. Nothing in the file is trusted: every member is checked when it is asked
/// for, and messages name the position (`accessors[3].count`).
class GltfFile {
 public:
  using Json = nlohmann::json;

  /// @throws FileError: truncated, no JSON, another version, a required extension that is not read, a buffer that is
  /// missing or too short
  GltfFile(const std::filesystem::path& path, const SceneLimits& limits);

  const std::filesystem::path& path() const { return path_; }
  const Json& root() const { return root_; }
  /// A list of objects of the root; empty when the file has none.
  const Json& list(const char* name) const;
  /// Names the extensions that the file requires and that are not read, where they change only its look; else empty.
  const std::string& look_warning() const { return look_warning_; }

  /// Numbers of an accessor as doubles. @param width values per row that are expected; 0: any
  /// @throws FileError for an index, a type or a range that the file does not have
  GltfNumbers numbers(std::size_t accessor, std::size_t width, const char* what) const;
  /// The bytes of a buffer view, decompressed where only compressed ones are there. @param where who asks, for messages
  /// @throws FileError for a range that its buffer does not have, or a damaged stream
  std::string_view bytes_of_view(int index, const std::string& where) const;
  /// Counts values that are read by other means than `numbers`. @throws FileError when they are more than any figure
  /// has
  void count_values(double values) const;
  /// The bytes of an image; empty when its file is missing.
  std::string image_bytes(std::size_t image) const;

  /// Members of an object, checked. `where` is for messages. @throws FileError for another type
  double number(const Json& object, const char* name, double fallback, const std::string& where) const;
  std::string text(const Json& object, const char* name) const;
  /// The member as a whole number; the fallback when it is absent. @throws FileError for a fraction or a huge number
  int whole(const Json& object, const char* name, int fallback, const std::string& where) const;
  /// An index below `count`, or -1 when it is absent and may be.
  int index(const Json& object, const char* name, std::size_t count, const std::string& where,
            bool needed = false) const;
  /// Numbers of a fixed count; empty when absent.
  std::vector<double> vector(const Json& object, const char* name, std::size_t count, const std::string& where) const;
  /// A member that is an array or an object; an empty one when absent.
  const Json& array(const Json& object, const char* name, const std::string& where) const;
  const Json& object(const Json& parent, const char* name) const;

  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at({path_.string(), 0}, format, std::forward<Args>(args)...);
  }

 private:
  struct View {
    std::string_view bytes;
    std::size_t stride = 0;  ///< 0: packed
  };
  void read_container(const std::string& file);
  void parse_json(std::string_view text);
  void check_extensions();
  /// What EXT_meshopt_compression says of a buffer or of a view; empty where it says nothing.
  const Json& meshopt_of(const Json& element) const;
  void read_buffers();
  std::string buffer_of_uri(const std::string& uri, const std::string& where) const;
  View view(int index, const std::string& where) const;
  std::string_view bytes_of_range(const Json& range, const std::string& who, const std::string& where) const;
  std::string_view unpacked_view(int index, const Json& packing, const std::string& element) const;
  std::size_t count_of(const Json& accessor, std::size_t width, bool stored, const std::string& where) const;
  void fill_sparse(const Json& accessor, const std::string& where, GltfNumbers& numbers, int component,
                   bool normalized) const;

  std::filesystem::path path_;
  SceneLimits limits_;
  Json root_;
  std::string binary_;  ///< of a .glb
  bool has_binary_ = false;
  mutable double values_read_ = 0;  ///< by all calls of `numbers`
  std::vector<std::string> buffers_;
  mutable std::map<int, std::string> unpacked_;  ///< compressed views that were asked for, by their index
  mutable std::size_t unpacked_bytes_ = 0;
  std::string look_warning_;
};

}  // namespace doppel
