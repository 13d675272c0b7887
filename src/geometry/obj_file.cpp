#include "doppel/geometry/obj_file.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <span>

#include "doppel/core/as_size.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

constexpr int kNone = -1;

/// The line after its first token: names of files and materials may contain blanks.
std::string rest_of_line(const TextReader& reader) {
  std::string_view rest = reader.line().substr(reader.tokens()[0].size());
  while (!rest.empty() && (rest[0] == ' ' || rest[0] == '\t')) rest.remove_prefix(1);
  return std::string(rest);
}

/// The line from a token on.
std::string line_from(const TextReader& reader, std::size_t token) {
  const std::string_view line = reader.line();
  return std::string(line.substr(as_size(reader.tokens()[token].data() - line.data())));
}

/// How many values an option of map_Kd has; a vector may leave out its last numbers.
struct MapOption {
  std::string_view name;
  std::size_t values;
  bool is_vector = false;
};
constexpr MapOption kMapOptions[] = {{"-blendu", 1},  {"-blendv", 1}, {"-boost", 1},      {"-bm", 1},
                                     {"-cc", 1},      {"-clamp", 1},  {"-imfchan", 1},    {"-mm", 2},
                                     {"-type", 1},    {"-texres", 1}, {"-colorspace", 1}, {"-o", 3, true},
                                     {"-s", 3, true}, {"-t", 3, true}};

/// The token at which the name of the texture begins, behind the options.
std::size_t texture_name_token(const TextReader& reader) {
  const auto& tokens = reader.tokens();
  std::size_t at = 1;
  while (at < tokens.size()) {
    const auto option = std::find_if(std::begin(kMapOptions), std::end(kMapOptions),
                                     [&](const MapOption& known) { return known.name == tokens[at]; });
    if (option == std::end(kMapOptions)) break;
    const std::size_t first = at + 1;
    const auto is_value = [&](std::size_t i) {
      return i < tokens.size() && i < first + option->values && (!option->is_vector || parse_number(tokens[i]));
    };
    for (at = first; is_value(at);) ++at;
  }
  return at;
}

/// The name of the texture of a line `map_Kd <options> <name>`; both the name and the options may have blanks.
std::string texture_name(const TextReader& reader, const std::filesystem::path& path) {
  const auto& tokens = reader.tokens();
  std::size_t first = texture_name_token(reader);
  if (first >= tokens.size()) reader.fail_here("reading a material file: map_Kd names no file");
  // An option that is not known has an unknown number of values: the longest rest of the line that is a file counts.
  if (tokens[first][0] == '-') {
    std::error_code none;
    const auto is_file = [&](std::size_t token) {
      return std::filesystem::is_regular_file(resolve_path(path, line_from(reader, token)), none);
    };
    while (first + 1 < tokens.size() && !is_file(first)) ++first;
  }
  std::string name = line_from(reader, first);
  if (name.size() > 2 && name.front() == '"' && name.back() == '"') name = name.substr(1, name.size() - 2);
  return name;
}

class ObjFileReader {
 public:
  ObjFileReader(const std::filesystem::path& path, double metres_per_unit)
      : reader_(path, "a mesh"), scale_(metres_per_unit) {}

  ObjFile read() {
    while (reader_.next_line()) read_line();
    if (file_.faces.empty())
      fail_at({reader_.path().string(), 0}, "reading a mesh: found {} vertices but no faces", file_.vertices.size());
    check_indices(file_.faces, file_.vertices.size(), "vertex");
    check_indices(file_.face_uvs, file_.uvs.size(), "texture coordinate");
    finish_colours();
    return std::move(file_);
  }

 private:
  void read_line() {
    const std::string_view key = reader_.tokens()[0];
    if (key == "v") return read_vertex();
    if (key == "vt") return read_uv();
    if (key == "f") return read_face();
    if (key == "vc") return separate_colours_.push_back(colour(1)), void();
    if (key == "mtllib") {
      file_.libraries.emplace_back(resolve_path(reader_.path(), rest_of_line(reader_)), reader_.where());
    } else if (key == "usemtl") {
      const int next = static_cast<int>(file_.materials.size());
      const auto [entry, added] = material_index_.try_emplace(rest_of_line(reader_), next);
      if (added) file_.materials.push_back(entry->first);
      material_ = entry->second;
    }
  }

  Eigen::Vector3d colour(std::size_t token) const {
    return {reader_.number(token, "red"), reader_.number(token + 1, "green"), reader_.number(token + 2, "blue")};
  }

  void read_vertex() {
    file_.vertices.emplace_back(reader_.length(1, "x", scale_), reader_.length(2, "y", scale_),
                                reader_.length(3, "z", scale_));
    if (reader_.tokens().size() < 7) return;
    // Vertices before the first coloured one are white, as in Skeletool.
    file_.colours.resize(file_.vertices.size(), Eigen::Vector3d::Ones());
    file_.colours.back() = colour(4);
  }

  void read_uv() {
    const double u = reader_.number(1, "u"), v = reader_.tokens().size() > 2 ? reader_.number(2, "v") : 0.0;
    file_.uvs.emplace_back(u, v);
  }

  /// One part of `v/vt/vn`: 1-based, or counted backwards from the newest when negative.
  int parse_index(std::string_view text, std::size_t known, const char* what) const {
    long value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const long lowest = -static_cast<long>(known), largest = std::numeric_limits<int>::max();
    if (error != std::errc() || rest != text.data() + text.size() || value == 0 || value < lowest || value > largest) {
      reader_.fail_here(
          "reading a mesh: \"{}\" is not a {} index (they count from 1, or backwards from -1; {} are known here)",
          text.substr(0, 40), what, known);
    }
    return static_cast<int>(value > 0 ? value - 1 : value - lowest);
  }

  std::pair<int, int> parse_corner(std::string_view token) const {
    const std::size_t slash = token.find('/');
    const int vertex = parse_index(token.substr(0, slash), file_.vertices.size(), "vertex");
    if (slash == std::string_view::npos) return {vertex, kNone};
    std::string_view uv = token.substr(slash + 1);
    uv = uv.substr(0, uv.find('/'));
    return {vertex, uv.empty() ? kNone : parse_index(uv, file_.uvs.size(), "texture coordinate")};
  }

  void read_face() {
    std::span<const std::string_view> tokens = reader_.tokens();
    const auto comment = std::find_if(tokens.begin(), tokens.end(), [](std::string_view t) { return t[0] == '#'; });
    tokens = tokens.first(as_size(comment - tokens.begin()));
    if (tokens.size() < 4)
      reader_.fail_here("reading a mesh: a face needs at least 3 corners, found {}", tokens.size() - 1);
    const std::pair<int, int> first = parse_corner(tokens[1]);
    std::pair<int, int> previous = parse_corner(tokens[2]);
    for (std::size_t i = 3; i < tokens.size(); ++i) {
      const std::pair<int, int> corner = parse_corner(tokens[i]);
      if ((corner.second == kNone) != (first.second == kNone) || (previous.second == kNone) != (first.second == kNone))
        reader_.fail_here(
            "reading a mesh: some corners have texture coordinates and some have none; give all of them or none");
      file_.faces.push_back({first.first, previous.first, corner.first});
      file_.face_uvs.push_back({first.second, previous.second, corner.second});
      file_.face_materials.push_back(material_);
      file_.face_lines.push_back(reader_.where().line);
      previous = corner;
    }
  }

  /// Faces may precede their vertices in the file, so indices are checked at the end.
  void check_indices(const std::vector<Triangle>& faces, std::size_t count, const char* what) const {
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (const int index : faces[f])
        if (index != kNone && as_size(index) >= count)
          fail_at({reader_.path().string(), file_.face_lines[f]},
                  "reading a mesh: this face names {} {}, but the file holds {}", what, static_cast<long>(index) + 1,
                  count);
  }

  void finish_colours() {
    if (file_.colours.empty() && separate_colours_.size() == file_.vertices.size()) file_.colours = separate_colours_;
    if (!file_.colours.empty()) file_.colours.resize(file_.vertices.size(), Eigen::Vector3d::Ones());
  }

  TextReader reader_;
  double scale_;
  ObjFile file_;
  std::vector<Eigen::Vector3d> separate_colours_;
  std::map<std::string, int> material_index_;
  int material_ = kNone;
};

}  // namespace

ObjFile read_obj_file(const std::filesystem::path& path, double metres_per_unit) {
  return ObjFileReader(path, metres_per_unit).read();
}

std::vector<ObjMaterial> read_mtl(const std::filesystem::path& path) {
  TextReader reader(path, "a material file");
  std::vector<ObjMaterial> materials;
  while (reader.next_line()) {
    const std::string_view key = reader.tokens()[0];
    if (key == "newmtl") materials.push_back({rest_of_line(reader), {}, {}, {}, reader.where()});
    if (key != "Kd" && key != "map_Kd") continue;
    if (materials.empty()) materials.push_back({"", {}, {}, {}, reader.where()});
    ObjMaterial& material = materials.back();
    // `Kd spectral file` names measurements, which are left out.
    if (key == "Kd" && reader.tokens().size() >= 4 && parse_number(reader.tokens()[1])) {
      material.colour.emplace(reader.number(1, "red"), reader.number(2, "green"), reader.number(3, "blue"));
      material.colour = material.colour->cwiseMax(0.0).cwiseMin(1.0);
    }
    if (key == "Kd") continue;
    const std::string name = texture_name(reader, path);
    // A second texture of a material is one more entry of the same name.
    if (!material.texture.empty()) materials.push_back(ObjMaterial(material));
    materials.back().written_texture = name;
    materials.back().texture = resolve_path(path, name);
    materials.back().where = reader.where();
  }
  return materials;
}

}  // namespace doppel
