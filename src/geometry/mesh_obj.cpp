#include <algorithm>
#include <charconv>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/mesh.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr int kNone = -1;

/// The line after its first token: names of files and materials may contain blanks.
std::string rest_of_line(const TextReader& reader) {
  std::string_view rest = reader.line().substr(reader.tokens()[0].size());
  while (!rest.empty() && (rest[0] == ' ' || rest[0] == '\t')) rest.remove_prefix(1);
  return std::string(rest);
}

struct MtlEntry {
  std::string material;
  fs::path texture;
  FileLocation where;
};

/// The colour textures of an MTL file, by material. Other properties of materials are ignored.
std::vector<MtlEntry> read_mtl(const fs::path& path) {
  TextReader reader(path, "a material file");
  std::vector<MtlEntry> entries;
  std::string material;
  while (reader.next_line()) {
    if (reader.tokens()[0] == "newmtl") material = rest_of_line(reader);
    if (reader.tokens()[0] != "map_Kd") continue;
    std::string name = rest_of_line(reader);
    if (name.empty()) reader.fail_here("reading a material file: map_Kd names no file");
    // Options such as `-s 1 1 1` stand before the name.
    if (name[0] == '-') name = std::string(reader.tokens().back());
    entries.push_back({material, resolve_path(path, name), reader.where()});
  }
  return entries;
}

cv::Mat read_texture(const MtlEntry& entry) {
  if (!fs::is_regular_file(entry.texture))
    fail_at(entry.where, "the texture {} does not exist", entry.texture.string());
  const std::string bytes = read_file(entry.texture);
  cv::Mat image;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    if (!bytes.empty() && bytes.size() < (1u << 30)) image = cv::imdecode(encoded, cv::IMREAD_COLOR);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) fail_at(entry.where, "the texture {} cannot be decoded", entry.texture.string());
  return image;
}

class ObjReader {
 public:
  ObjReader(const fs::path& path, double metres_per_unit) : reader_(path, "a mesh"), scale_(metres_per_unit) {}

  TriangleMesh read() {
    while (reader_.next_line()) read_line();
    if (mesh_.faces.empty())
      fail_at({reader_.path().string(), 0}, "reading a mesh: found {} vertices but no faces", mesh_.vertices.size());
    check_indices();
    finish_colours();
    if (!mesh_.uvs.empty() && !mesh_.face_uvs.empty()) read_textures();
    return std::move(mesh_);
  }

 private:
  void read_line() {
    const std::string_view key = reader_.tokens()[0];
    if (key == "v") return read_vertex();
    if (key == "vt") return read_uv();
    if (key == "f") return read_face();
    if (key == "vc") return separate_colours_.push_back(colour(1)), void();
    if (key == "mtllib") libraries_.emplace_back(resolve_path(reader_.path(), rest_of_line(reader_)), reader_.where());
    if (key == "usemtl") materials_.insert(rest_of_line(reader_));
    // Normals are computed from the surface; groups and smoothing are ignored.
  }

  Eigen::Vector3d colour(std::size_t token) const {
    return {reader_.number(token, "red"), reader_.number(token + 1, "green"), reader_.number(token + 2, "blue")};
  }

  void read_vertex() {
    const Eigen::Vector3d position{reader_.number(1, "x"), reader_.number(2, "y"), reader_.number(3, "z")};
    mesh_.vertices.emplace_back(scale_ * position);
    if (reader_.tokens().size() < 7) return;
    // Vertices before the first coloured one are white, as in Skeletool.
    mesh_.colours.resize(mesh_.vertices.size(), Eigen::Vector3d::Ones());
    mesh_.colours.back() = colour(4);
  }

  void read_uv() {
    const double u = reader_.number(1, "u"), v = reader_.number(2, "v");
    mesh_.uvs.emplace_back(u, v);
  }

  /// One part of `v/vt/vn`: 1-based, or counted backwards from the newest when negative.
  int parse_index(std::string_view text, std::size_t known, const char* what) const {
    long value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const long index = value > 0 ? value - 1 : static_cast<long>(known) + value;
    if (error != std::errc() || rest != text.data() + text.size() || value == 0 || index < 0 ||
        index > std::numeric_limits<int>::max()) {
      reader_.fail_here(
          "reading a mesh: \"{}\" is not a {} index (they count from 1, or backwards from -1; {} are known here)",
          text.substr(0, 40), what, known);
    }
    return static_cast<int>(index);
  }

  std::pair<int, int> parse_corner(std::string_view token) const {
    const std::size_t slash = token.find('/');
    const int vertex = parse_index(token.substr(0, slash), mesh_.vertices.size(), "vertex");
    if (slash == std::string_view::npos) return {vertex, kNone};
    std::string_view uv = token.substr(slash + 1);
    uv = uv.substr(0, uv.find('/'));
    return {vertex, uv.empty() ? kNone : parse_index(uv, mesh_.uvs.size(), "texture coordinate")};
  }

  void read_face() {
    const auto& tokens = reader_.tokens();
    if (tokens.size() < 4)
      reader_.fail_here("reading a mesh: a face needs at least 3 corners, found {}", tokens.size() - 1);
    const std::pair<int, int> first = parse_corner(tokens[1]);
    std::pair<int, int> previous = parse_corner(tokens[2]);
    for (std::size_t i = 3; i < tokens.size(); ++i) {
      const std::pair<int, int> corner = parse_corner(tokens[i]);
      add_triangle(first, previous, corner);
      previous = corner;
    }
  }

  void add_triangle(const std::pair<int, int>& a, const std::pair<int, int>& b, const std::pair<int, int>& c) {
    const int with_uv = (a.second != kNone) + (b.second != kNone) + (c.second != kNone);
    const bool all_before = mesh_.face_uvs.size() == mesh_.faces.size();
    if ((with_uv != 0 && with_uv != 3) || (with_uv == 3 ? !all_before : !mesh_.face_uvs.empty())) {
      reader_.fail_here(
          "reading a mesh: some corners have texture coordinates and some have none; give all of them or none");
    }
    mesh_.faces.push_back({a.first, b.first, c.first});
    face_lines_.push_back(reader_.where().line);
    if (with_uv) mesh_.face_uvs.push_back({a.second, b.second, c.second});
  }

  /// Faces may precede their vertices in the file, so indices are checked at the end.
  void check_indices() const {
    const auto check = [&](const std::vector<Triangle>& faces, std::size_t count, const char* what) {
      for (std::size_t f = 0; f < faces.size(); ++f) {
        for (int index : faces[f]) {
          if (as_size(index) < count) continue;
          fail_at({reader_.path().string(), face_lines_[f]},
                  "reading a mesh: this face names {} {}, but the file holds {}", what, static_cast<long>(index) + 1,
                  count);
        }
      }
    };
    check(mesh_.faces, mesh_.vertices.size(), "vertex");
    check(mesh_.face_uvs, mesh_.uvs.size(), "texture coordinate");
  }

  void finish_colours() {
    if (mesh_.colours.empty() && separate_colours_.size() == mesh_.vertices.size()) mesh_.colours = separate_colours_;
    if (!mesh_.colours.empty()) mesh_.colours.resize(mesh_.vertices.size(), Eigen::Vector3d::Ones());
  }

  void read_textures() {
    std::vector<MtlEntry> textures;
    for (const auto& [library, where] : libraries_) {
      if (!fs::is_regular_file(library)) {
        log::warn("{}: the material file {} does not exist; the mesh has no texture", where.to_string(),
                  library.string());
        continue;
      }
      for (const MtlEntry& entry : read_mtl(library)) {
        const bool used = materials_.empty() || materials_.count(entry.material) != 0;
        const bool known = std::any_of(textures.begin(), textures.end(),
                                       [&](const MtlEntry& t) { return t.texture == entry.texture; });
        if (used && !known) textures.push_back(entry);
      }
    }
    if (textures.size() > 1) {
      fail_at(textures[1].where, "the mesh {} uses {} textures, Doppel's meshes have one; bake them into one image",
              reader_.path().string(), textures.size());
    }
    if (!textures.empty()) mesh_.texture = read_texture(textures.front());
  }

  TextReader reader_;
  double scale_;
  TriangleMesh mesh_;
  std::vector<int> face_lines_;
  std::vector<Eigen::Vector3d> separate_colours_;
  std::vector<std::pair<fs::path, FileLocation>> libraries_;
  std::set<std::string> materials_;
};

std::string obj_text(const TriangleMesh& mesh, double metres_per_unit, const std::string& material_file) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  if (!material_file.empty()) fmt::format_to(out, "mtllib {}\nusemtl {}\n", material_file, kObjMaterial);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d v = mesh.vertices[i] / metres_per_unit;
    fmt::format_to(out, "v {} {} {}", v.x(), v.y(), v.z());
    if (!mesh.colours.empty())
      fmt::format_to(out, " {} {} {}", mesh.colours[i].x(), mesh.colours[i].y(), mesh.colours[i].z());
    fmt::format_to(out, "\n");
  }
  for (const Eigen::Vector2d& uv : mesh.uvs) fmt::format_to(out, "vt {} {}\n", uv.x(), uv.y());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    fmt::format_to(out, "f");
    for (int corner = 0; corner < 3; ++corner) {
      fmt::format_to(out, " {}", mesh.faces[f][corner] + 1);
      if (!mesh.face_uvs.empty()) fmt::format_to(out, "/{}", mesh.face_uvs[f][corner] + 1);
    }
    fmt::format_to(out, "\n");
  }
  return fmt::to_string(text);
}

}  // namespace

TriangleMesh read_obj(const fs::path& path, double metres_per_unit) {
  if (!(metres_per_unit > 0))
    fail("reading {}: metres per unit is {}, it must be positive", path.string(), metres_per_unit);
  return ObjReader(path, metres_per_unit).read();
}

void write_obj(const fs::path& path, const TriangleMesh& mesh, double metres_per_unit) {
  if (!(metres_per_unit > 0))
    fail("writing {}: metres per unit is {}, it must be positive", path.string(), metres_per_unit);
  if (!mesh.colours.empty() && mesh.colours.size() != mesh.vertices.size()) {
    fail("writing {}: found {} colours for {} vertices", path.string(), mesh.colours.size(), mesh.vertices.size());
  }
  if (!mesh.face_uvs.empty() && mesh.face_uvs.size() != mesh.faces.size()) {
    fail("writing {}: found texture coordinates of {} faces for {} faces", path.string(), mesh.face_uvs.size(),
         mesh.faces.size());
  }
  std::string material_file;
  if (!mesh.texture.empty()) {
    const fs::path texture = fs::path(path).replace_extension(".png"),
                   material = fs::path(path).replace_extension(".mtl");
    write_image(texture, mesh.texture);
    write_atomically(material, fmt::format("newmtl {}\nmap_Kd {}\n", kObjMaterial, texture.filename().string()));
    material_file = material.filename().string();
  }
  write_atomically(path, obj_text(mesh, metres_per_unit, material_file));
}

}  // namespace doppel
