#include <cmath>
#include <cstring>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/lower_case.h"
#include "doppel/core/text_reader.h"
#include "doppel/io/scene/readers.h"

namespace doppel {

namespace {

constexpr std::size_t kStlHeader = 84, kStlTriangle = 50;

/// Gives equal positions one vertex: an open-addressed table of indices into the vertices.
class VertexJoiner {
 public:
  explicit VertexJoiner(std::vector<Eigen::Vector3d>& vertices) : vertices_(vertices), slots_(1024, -1) {}

  int index_of(Eigen::Vector3d position) {
    position.array() += 0.0;  // -0 is 0
    if (2 * vertices_.size() >= slots_.size()) grow();
    std::size_t slot = slot_of(position);
    for (; slots_[slot] >= 0; slot = (slot + 1) & (slots_.size() - 1))
      if (vertices_[slots_[slot]] == position) return slots_[slot];
    slots_[slot] = static_cast<int>(vertices_.size());
    vertices_.push_back(position);
    return slots_[slot];
  }

 private:
  std::size_t slot_of(const Eigen::Vector3d& position) const {
    std::uint64_t mixed = 0;
    for (int axis = 0; axis < 3; ++axis) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &position[axis], sizeof bits);
      mixed = (mixed ^ bits) * 0x9E3779B97F4A7C15U;
      mixed ^= mixed >> 29;
    }
    return static_cast<std::size_t>(mixed) & (slots_.size() - 1);
  }
  void grow() {
    slots_.assign(2 * slots_.size(), -1);
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      std::size_t slot = slot_of(vertices_[v]);
      while (slots_[slot] >= 0) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = static_cast<int>(v);
    }
  }

  std::vector<Eigen::Vector3d>& vertices_;
  std::vector<int> slots_;
};

class StlReader {
 public:
  StlReader(const std::filesystem::path& path, const SceneLimits& limits)
      : path_(path), limits_(limits), joiner_(primitive_.vertices) {}

  Scene read() {
    std::string bytes = read_file(path_);
    if (is_binary(bytes)) {
      read_binary(bytes);
    } else {
      bytes = std::string();
      read_text();
    }
    Scene scene;
    scene.nodes.emplace_back().name = path_.stem().string();
    primitive_.name = scene.nodes[0].name;
    scene.primitives.push_back(std::move(primitive_));
    return scene;
  }

 private:
  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at({path_.string(), 0}, format, std::forward<Args>(args)...);
  }

  static std::size_t triangles_of(const std::string& bytes) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + kStlHeader - sizeof count, sizeof count);
    return count;
  }
  /// Many binary files begin with `solid` too, so the announced length decides first. Text holds no zero bytes.
  static bool is_binary(const std::string& bytes) {
    if (bytes.size() >= kStlHeader && bytes.size() == kStlHeader + kStlTriangle * triangles_of(bytes)) return true;
    const std::size_t first = bytes.find_first_not_of(" \t\r\n");
    const bool solid = first != std::string::npos && bytes.compare(first, 5, "solid") == 0;
    return !solid || (bytes.size() >= kStlHeader && std::memchr(bytes.data(), 0, bytes.size()));
  }

  void check_count(std::size_t triangles) const {
    if (triangles > as_size(limits_.triangles))
      fail_here("the file has {} triangles; at most {} are read", triangles, limits_.triangles);
  }

  void read_binary(const std::string& bytes) {
    if (bytes.size() < kStlHeader)
      fail_here("is no STL file: it has {} bytes; a binary one has at least {}, a text begins with 'solid'",
                bytes.size(), kStlHeader);
    const std::size_t count = triangles_of(bytes);
    if (bytes.size() < kStlHeader + kStlTriangle * count)
      fail_here("the file is truncated: its header announces {} triangles ({} bytes), it has {} bytes", count,
                kStlHeader + kStlTriangle * count, bytes.size());
    check_count(count);
    primitive_.faces.reserve(count);
    for (std::size_t t = 0; t < count; ++t) {
      float corners[9];
      std::memcpy(corners, bytes.data() + kStlHeader + kStlTriangle * t + 12, sizeof corners);
      Triangle face{};
      for (std::size_t c = 0; c < 3; ++c) {
        const Eigen::Vector3d position(corners[3 * c], corners[3 * c + 1], corners[3 * c + 2]);
        if (!position.allFinite()) fail_here("triangle {} has a position that is not finite", t);
        face[c] = joiner_.index_of(position);
      }
      primitive_.faces.push_back(face);
    }
  }

  void read_text() {
    TextReader reader(path_, "an STL file");
    std::vector<int> loop;
    while (reader.next_line()) {
      const std::string key = lower_case(std::string(reader.tokens()[0]));
      if (key == "vertex") {
        const double x = reader.number(1, "x"), y = reader.number(2, "y"), z = reader.number(3, "z");
        loop.push_back(joiner_.index_of({x, y, z}));
      } else if (key == "endloop") {
        if (loop.size() < 3) reader.fail_here("reading an STL file: a facet needs 3 vertices, found {}", loop.size());
        for (std::size_t i = 2; i < loop.size(); ++i) primitive_.faces.push_back({loop[0], loop[i - 1], loop[i]});
        check_count(primitive_.faces.size());
        loop.clear();
      } else if (key == "facet" && !loop.empty()) {
        reader.fail_here("reading an STL file: 'facet' stands inside a facet, which has no end");
      } else if (key != "solid" && key != "endsolid" && key != "facet" && key != "outer" && key != "endfacet") {
        reader.fail_here("reading an STL file: '{}' is no word of this format (facet, outer loop, vertex, ...)",
                         key.substr(0, 40));
      }
    }
    if (!loop.empty()) reader.fail_here("reading an STL file: the file is truncated: its last facet has no end");
  }

  std::filesystem::path path_;
  SceneLimits limits_;
  ScenePrimitive primitive_;
  VertexJoiner joiner_;
};

}  // namespace

Scene read_stl(const std::filesystem::path& path, const SceneLimits& limits) { return StlReader(path, limits).read(); }

}  // namespace doppel
