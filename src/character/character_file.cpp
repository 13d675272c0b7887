#include <algorithm>
#include <map>
#include <set>

#include "doppel/character/character.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/file_text.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr char kCharacterHeader[] = "skeletool character file v1.0";

/// The content of a `.character` file; `pose` may be empty.
struct CharacterFiles {
  fs::path skeleton, mesh, skin, pose;
  SkinningMode skinning = SkinningMode::dual_quaternion;
};

fs::path read_file_name(TextReader& reader, const fs::path& path, const std::string& keyword) {
  const fs::path file = resolve_path(path, reader.line());
  std::error_code unreadable;  // an invalid file name counts as a missing file
  if (!fs::is_regular_file(file, unreadable))
    reader.fail_here("the {} '{}' does not exist (looked for {})", keyword, excerpt(reader.line()),
                     excerpt(file.string(), 400));
  return file;
}

SkinningMode read_skinning_mode(const TextReader& reader) {
  const std::string_view word = reader.line();
  if (word == "linear") return SkinningMode::linear;
  if (word != "dual_quaternion") reader.fail_here("'{}' is no skinning; give linear or dual_quaternion", excerpt(word));
  return SkinningMode::dual_quaternion;
}

CharacterFiles read_character_lines(const fs::path& path) {
  TextReader reader(path, "a character file");
  require_version(reader, kCharacterHeader, "character", "character file");
  CharacterFiles files;
  const std::map<std::string, fs::path*> named{
      {"skeleton", &files.skeleton}, {"mesh", &files.mesh}, {"skin", &files.skin}, {"pose", &files.pose}};
  std::set<std::string> seen;
  while (reader.next_line()) {
    const std::string keyword(reader.line());
    if (keyword != "skinning" && !named.count(keyword))
      reader.fail_here("'{}' is not known here; the keywords are skeleton, mesh, skin, pose and skinning",
                       excerpt(keyword));
    if (!seen.insert(keyword).second) reader.fail_here("'{}' occurs a second time", keyword);
    if (keyword == "skinning") {
      reader.require_line("linear or dual_quaternion");
      files.skinning = read_skinning_mode(reader);
    } else {
      reader.require_line(fmt::format("the path of the {}", keyword));
      *named.at(keyword) = read_file_name(reader, path, keyword);
    }
  }
  for (const char* needed : {"skeleton", "mesh", "skin"})
    if (!seen.count(needed))
      fail_at({path.string(), 0}, "the file names no {}; it needs skeleton, mesh and skin", needed);
  return files;
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// The graph OBJ beside the mesh, under the names used by the datasets; empty when there is none.
fs::path find_graph(const fs::path& character_file, const fs::path& mesh_file) {
  const fs::path folder = mesh_file.parent_path();
  for (const std::string& stem : {mesh_file.stem().string(), character_file.stem().string()})
    for (const std::string& name : {stem + "_graph.obj", stem + "Simplified.obj"})
      if (fs::is_regular_file(folder / name)) return folder / name;
  if (fs::is_regular_file(folder / "simplified.obj")) return folder / "simplified.obj";
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? fs::path(".") : folder))
    if (entry.is_regular_file() && ends_with(entry.path().filename().string(), "_graph.obj"))
      others.push_back(entry.path());
  std::sort(others.begin(), others.end());
  if (others.size() > 1)
    fail("{}: two graphs lie beside the mesh, {} and {}; rename one to {}_graph.obj", character_file.string(),
         others[0].filename().string(), others[1].filename().string(), mesh_file.stem().string());
  return others.empty() ? fs::path() : others[0];
}

std::vector<double> read_rest_pose(const fs::path& path, int num_dofs) {
  return path.empty() ? std::vector<double>(num_dofs, 0.0) : read_motion(path, num_dofs).frames[0];
}

void read_skin_of(const CharacterFiles& files, Character& character) {
  character.skin = read_skin(files.skin);
  if (character.skin.num_vertices() != character.num_vertices())
    fail("{} has weights for {} vertices, but the mesh {} has {}; they do not belong together", files.skin.string(),
         character.skin.num_vertices(), files.mesh.string(), character.num_vertices());
}

void find_bones(const CharacterFiles& files, Character& character) {
  try {
    complete_character(character);
  } catch (const Error& e) {
    fail("{} does not fit {}: {}", files.skin.string(), files.skeleton.string(), e.what());
  }
}

/// Warns about a skeleton outside the body, which has a wrong pose or unit. Skinning would give a wrong surface without
/// an error.
void check_skeleton_distance(const fs::path& path, const CharacterFiles& files, const Character& character) {
  const double distance = skeleton_distance(character);
  if (distance > kSkeletonOffTemplate)
    log::warn("{}: in the rest pose the joints lie {:.3g} m from the template (median); {}", path.string(), distance,
              files.pose.empty() ? "the file names no pose, so all DoFs are 0: is a 'pose' missing?"
                                 : "is it the pose of the template's scan, and are all files in millimetres?");
}

void read_graph(const fs::path& path, const CharacterFiles& files, Character& character) {
  character.graph_source = find_graph(path, files.mesh);
  if (character.graph_source.empty()) {
    const int nodes = std::min(character.options.num_nodes, character.num_vertices());
    character.graph = build_graph(character.mesh, nodes, character.options.graph);
    return;
  }
  const TriangleMesh coarse = read_obj(character.graph_source, kMetresPerMillimetre);
  if (coarse.num_vertices() > character.num_vertices())
    fail("{} has {} vertices, but the mesh {} only {}; a graph is coarser than its template",
         character.graph_source.string(), coarse.num_vertices(), files.mesh.string(), character.num_vertices());
  character.graph = build_graph(character.mesh, coarse, character.options.graph);
}

/// The graph as a mesh whose vertices are the nodes, so that reading the mesh restores the nodes and edges.
TriangleMesh graph_mesh(const Character& character) {
  TriangleMesh mesh;
  for (const int vertex : character.graph.node_vertex) mesh.vertices.push_back(character.mesh.vertices[vertex]);
  mesh.faces = character.graph.faces;
  return mesh;
}

/// The file itself, or the one in a folder.
fs::path character_file_of(const fs::path& path) {
  std::error_code none;
  if (!fs::is_directory(path, none)) return path;
  const fs::path file = character_of_folder(path);
  if (file.empty())
    fail<UsageError>("{} is a folder without a .character file; name a .character file or its folder", path.string());
  return file;
}

void write_labels(const fs::path& path, const Character& character) {
  if (!character.labels.empty()) return write_segmentation(path, character.labels);
  if (fs::exists(path))
    fail(
        "{} exists, but this character has no labels and would get those of the file when read back; write it to an "
        "empty folder",
        path.string());
}

}  // namespace

Skeleton read_character_skeleton(const fs::path& path) {
  return read_skeleton(read_character_lines(character_file_of(path)).skeleton);
}

Character load_character(const fs::path& given, const CharacterOptions& options) {
  const fs::path path = character_file_of(given);
  const CharacterFiles files = read_character_lines(path);
  Character character;
  character.name = path.stem().string();
  character.options = options;
  character.skinning = files.skinning;
  character.mesh = read_obj(files.mesh, kMetresPerMillimetre);
  character.skeleton = read_skeleton(files.skeleton);
  character.rest_dofs = read_rest_pose(files.pose, character.num_dofs());
  decide_marker_reading(character.skeleton, character.rest_dofs, character.mesh);
  read_skin_of(files, character);
  const fs::path segmentation = files.mesh.parent_path() / "segmentation.txt";
  if (fs::exists(segmentation)) character.labels = read_segmentation(segmentation, character.num_vertices());
  if (character.labels.empty())
    log::warn(
        "{}: there is no segmentation.txt beside the mesh, so materials are unknown: every vertex has rigidity 1, and "
        "ARAP, Laplacian and smoothness treat skin and cloth alike",
        path.string());
  find_bones(files, character);
  check_skeleton_distance(path, files, character);
  read_graph(path, files, character);
  return character;
}

fs::path write_character(const fs::path& folder, const Character& character) {
  if (character.name.empty()) fail("a character needs a name before it can be written; its files have this name");
  if (character.graph.faces.empty())
    fail("the graph of character '{}' has no faces, so it cannot be written as a mesh; build it with build_graph",
         character.name);
  const std::string& name = character.name;
  write_labels(folder / "segmentation.txt", character);
  write_skeleton(folder / (name + ".skeleton"), character.skeleton);
  write_skin(folder / (name + ".skin"), character.skin);
  write_motion(folder / (name + ".motion"), Motion{{character.rest_dofs}, {0}}, true);
  write_obj(folder / (name + ".obj"), character.mesh, kMetresPerMillimetre);
  write_obj(folder / (name + "_graph.obj"), graph_mesh(character), kMetresPerMillimetre);
  // Written last, so that a folder with a .character file is complete.
  const fs::path path = folder / (name + ".character");
  std::string text = fmt::format(
      "{0}\nskeleton\n  {1}.skeleton\nmesh\n  {1}.obj\nskin\n  {1}.skin\npose\n  {1}.motion\n", kCharacterHeader, name);
  // Written only where needed: other programs do not know the keyword.
  if (character.skinning == SkinningMode::linear) text += "skinning\n  linear\n";
  write_atomically(path, text);
  return path;
}

}  // namespace doppel
