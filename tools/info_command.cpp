#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "character_report.h"
#include "command.h"
#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/camera_plan.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/topology.h"
#include "info_files.h"
#include "key_tables.h"
#include "number_checks.h"
#include "versions.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct InfoOptions {
  std::string path, bone_rule = "exact", metric = "hops", unit, up, subject, image, keys;
  double metres_per_unit = 0.001;
  bool verbose = false, versions = false;
};

const char* const kLabelNames[] = {"background", "hat",        "hair",       "glove",     "sunglasses", "upper clothes",
                                   "dress",      "coat",       "socks",      "pants",     "jumpsuit",   "scarf",
                                   "skirt",      "face",       "left arm",   "right arm", "left leg",   "right leg",
                                   "left shoe",  "right shoe", "under dress"};

Json vector_json(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json describe_mesh(const TriangleMesh& mesh) {
  const MeshReport report = inspect_mesh(mesh);
  Eigen::Vector3d low = mesh.vertices[0], high = mesh.vertices[0];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  Json json;
  json["vertices"] = mesh.num_vertices();
  json["faces"] = mesh.num_faces();
  json["uvs"] = mesh.uvs.size();
  json["texture"] = mesh.texture.empty() ? "none" : fmt::format("{}x{}", mesh.texture.cols, mesh.texture.rows);
  json["lowest_m"] = vector_json(low);
  json["highest_m"] = vector_json(high);
  json["closed"] = report.closed();
  json["components"] = report.components;
  json["boundary_edges"] = report.boundary_edges;
  json["non_manifold_edges"] = report.non_manifold_edges;
  json["degenerate_faces"] = report.degenerate_faces;
  json["isolated_vertices"] = report.isolated_vertices;
  json["euler_characteristic"] = report.euler_characteristic;
  return json;
}

/// The smallest, mean and largest number of items in a row, for example influences of a vertex.
Json describe_rows(const IndexRows& rows) {
  int smallest = rows.num_rows() > 0 ? rows.size(0) : 0, largest = smallest;
  for (int r = 0; r < rows.num_rows(); ++r) {
    smallest = std::min(smallest, rows.size(r));
    largest = std::max(largest, rows.size(r));
  }
  Json json;
  json["min"] = smallest;
  json["mean"] = rows.num_rows() > 0 ? static_cast<double>(rows.items.size()) / rows.num_rows() : 0.0;
  json["max"] = largest;
  return json;
}

/// The root's axes in the order of application, with DoF and weight of each.
Json describe_root(const Skeleton& skeleton) {
  Json json;
  try {
    const Skeleton::Root root = skeleton.root();
    std::string order = "tx ty tz";
    for (int i = 0; i < 3; ++i) order += std::string(" r") + "xyz"[root.axes[i]];
    json["order"] = order;
    for (int i = 0; i < 3; ++i)
      json[std::string("t") + "xyz"[i]] =
          fmt::format("{} ({} m per unit)", skeleton.dofs[root.translation[i]].name, root.translation_weight[i]);
    for (int i = 0; i < 3; ++i)
      json[std::string("r") + "xyz"[root.axes[i]]] =
          fmt::format("{} ({} rad per unit)", skeleton.dofs[root.rotation[i]].name, root.rotation_weight[i]);
  } catch (const Error& e) {
    json["order"] = std::string("not readable: ") + e.what();
  }
  return json;
}

Json describe_dofs(const Skeleton& skeleton) {
  Json json;
  for (const Dof& dof : skeleton.dofs) {
    std::string text = dof.limits ? fmt::format("limits {} {}", (*dof.limits)[0], (*dof.limits)[1]) : "no limits";
    text += dof.joints.empty() ? "; drives nothing" : "; drives";
    for (const Dof::Drive& drive : dof.joints)
      text += fmt::format(" {} x {}", skeleton.joints[drive.joint].name, drive.weight);
    json[dof.name] = text;
  }
  return json;
}

Json describe_skeleton(const Skeleton& skeleton, bool verbose) {
  const auto count = [&](auto predicate) {
    return std::count_if(skeleton.dofs.begin(), skeleton.dofs.end(), predicate);
  };
  Json json;
  json["joints"] = skeleton.num_joints();
  json["dofs"] = skeleton.num_dofs();
  json["dofs_with_limits"] = count([](const Dof& dof) { return dof.limits.has_value(); });
  json["dofs_without_joints"] = count([](const Dof& dof) { return dof.joints.empty(); });
  json["markers"] = skeleton.markers.size();
  json["joints_reordered"] = !skeleton.file_order.empty();
  json["root"] = describe_root(skeleton);
  if (verbose) json["dof_list"] = describe_dofs(skeleton);
  return json;
}

Json describe_skin(const SkinningWeights& skin) {
  Json json;
  json["vertices"] = skin.num_vertices();
  json["bones"] = skin.num_bones();
  json["influences"] = describe_rows(skin.vertex_bones);
  json["glued_weights_repaired"] = skin.repaired;
  return json;
}

Json describe_graph(const Character& character) {
  const EmbeddedGraph& graph = character.graph;
  const bool hops = character.options.graph.metric == GraphMetric::hops;
  const auto [low, high] = std::minmax_element(graph.radius.begin(), graph.radius.end());
  Json json;
  json["nodes"] = graph.num_nodes();
  json["edges"] = graph.edges.size();
  json["source"] = character.graph_source.empty() ? "decimated from the mesh" : character.graph_source.string();
  json["metric"] = hops ? "hops" : "geodesic";
  json["falloff"] = character.options.graph.falloff == GraphFalloff::smooth ? "smooth" : "truncated";
  json["radius_unit"] = hops ? "hops" : "metres";
  json["radius_min"] = *low;
  json["radius_max"] = *high;
  json["nodes_above_smallest_radius"] =
      std::count_if(graph.radius.begin(), graph.radius.end(), [low = *low](double r) { return r > low; });
  json["influences"] = describe_rows(graph.vertex_nodes);
  return json;
}

Json describe_labels(const Character& character) {
  Json json;
  if (character.labels.empty()) return "none (no segmentation.txt): rigidity 1 everywhere";
  std::map<int, int> count;
  for (const int label : character.labels) ++count[label];
  for (const auto& [label, n] : count) json[fmt::format("{} {}", label, kLabelNames[label])] = n;
  return json;
}

Json describe_markers(const Character& character) {
  Skeleton skeleton = character.skeleton;
  const MarkerDistances distance = decide_marker_reading(skeleton, character.rest_dofs, character.mesh);
  Json json;
  json["reading"] = skeleton.marker_reading == MarkerReading::joint_relative
                        ? "relative to the joint"
                        : "world positions in the pose of all zeros";
  json["median_distance_m_joint_relative"] = distance.joint_relative;
  json["median_distance_m_zero_pose_world"] = distance.zero_pose_world;
  return json;
}

Json describe_motion(const fs::path& path) {
  // A motion file does not state the number of DoFs; its first row shows it.
  int columns = 0;
  {
    TextReader reader(path, "a motion file");
    if (reader.next_line() && reader.next_line()) columns = static_cast<int>(reader.tokens().size()) - 1;
  }
  const Motion motion = read_motion(path, std::max(1, columns));
  Json json;
  json["kind"] = "motion";
  json["frames"] = motion.num_frames();
  json["dofs"] = columns;
  json["first_id"] = motion.ids.front();
  json["last_id"] = motion.ids.back();
  json["ids_without_gaps"] = std::adjacent_find(motion.ids.begin(), motion.ids.end(),
                                                [](long a, long b) { return b != a + 1; }) == motion.ids.end();
  return json;
}

std::string lens_text(const Camera& camera) { return camera.has_distortion() ? lens_name(camera.lens) : "pinhole"; }

/// A camera in the program's world.
Json describe_camera(const Camera& camera, bool has_pose) {
  const auto list = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  Json json;
  json["name"] = camera.name;
  json["width"] = camera.width > 0 ? Json(camera.width) : Json();
  json["height"] = camera.height > 0 ? Json(camera.height) : Json();
  json["model"] = lens_text(camera);
  json["fx"] = camera.K(0, 0);
  json["fy"] = camera.K(1, 1);
  json["cx"] = camera.K(0, 2);
  json["cy"] = camera.K(1, 2);
  json["skew"] = camera.K(0, 1);
  json["coefficients"] = camera.has_distortion() ? Json(camera.distortion) : Json::array();
  if (!has_pose) return json;
  json["centre_m"] = list(camera.centre());
  json["direction"] = list(camera.R.row(2).transpose());
  json["image_up"] = list(-camera.R.row(1).transpose());
  return json;
}

Json describe_calibration(const Calibration& calibration) {
  Json json;
  json["kind"] = "calibration";
  json["format"] = calibration.format;
  json["unit"] = calibration.unit;
  json["up"] = calibration.up;
  if (!calibration.has_poses) json["poses"] = "none: the file holds intrinsics only";
  json["cameras"] = Json::array();
  for (const Camera& camera : calibration.cameras)
    json["cameras"].push_back(describe_camera(camera, calibration.has_poses));
  if (!calibration.notes.empty()) json["notes"] = calibration.notes;
  return json;
}

/// One line a camera.
std::string camera_lines(const Calibration& calibration) {
  std::string text = fmt::format("{:<16} {:>11} {:<10} {:>19} {:>19} {:>26}\n", "camera", "pixels", "lens",
                                 "focal length", "principal point", "centre, m");
  for (const Camera& camera : calibration.cameras) {
    const std::string size = camera.width > 0 ? fmt::format("{}x{}", camera.width, camera.height) : "not stated";
    const Eigen::Vector3d c = camera.centre();
    const std::string centre =
        calibration.has_poses ? fmt::format("{:8.3f} {:8.3f} {:8.3f}", c.x(), c.y(), c.z()) : "not stated";
    text += fmt::format("{:<16} {:>11} {:<10} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>26}\n", camera.name, size,
                        lens_text(camera), camera.K(0, 0), camera.K(1, 1), camera.K(0, 2), camera.K(1, 2), centre);
  }
  return text;
}

/// Distances between cameras, metres: what a tape measure in the studio can confirm.
std::string distance_lines(const std::vector<Camera>& cameras) {
  const std::size_t shown = std::min<std::size_t>(cameras.size(), 12);
  std::string text = fmt::format("distance between cameras, m{}\n",
                                 shown < cameras.size() ? fmt::format(" (the first {})", shown) : "");
  for (std::size_t row = 1; row < shown; ++row) {
    text += fmt::format("{:<16}", cameras[row].name);
    for (std::size_t column = 0; column < row; ++column)
      text += fmt::format(" {:6.3f}", (cameras[row].centre() - cameras[column].centre()).norm());
    text += "\n";
  }
  return text;
}

std::string calibration_text(const Calibration& calibration) {
  std::string text = fmt::format("calibration: format {}, unit {}, up {}, {} cameras\n", calibration.format,
                                 calibration.unit, calibration.up, calibration.cameras.size());
  text += camera_lines(calibration);
  for (const std::string& note : calibration.notes) text += fmt::format("note: {}\n", note);
  if (calibration.has_poses && calibration.cameras.size() > 1) text += distance_lines(calibration.cameras);
  return text;
}

/// What `info` prints: `json` for machines; for people `text`, or the keys and values of `json` if there is no text.
struct Report {
  Report(Json document) : json(std::move(document)) {}
  Report(Json document, std::string lines) : json(std::move(document)), text(std::move(lines)) {}

  Json json;
  std::string text;
};

Report report_calibration(const InfoOptions& options) {
  const Calibration calibration = load_calibration(options.path, {options.unit, options.up, options.subject});
  Report report(describe_calibration(calibration), calibration_text(calibration));
  if (options.image.empty()) return report;
  if (!calibration.has_poses) fail<UsageError>("--picture: {} holds intrinsics only", options.path);
  write_image(options.image, draw_camera_plan(calibration.cameras));
  report.json["picture"] = options.image;
  return report;
}

Json with_kind(const char* kind, const Json& part) {
  Json json;
  json["kind"] = kind;
  json.update(part);
  return json;
}

CharacterOptions character_options(const InfoOptions& options) {
  CharacterOptions result;
  result.bone_rule = options.bone_rule == "prefix" ? BoneRule::prefix : BoneRule::exact;
  result.graph.metric = options.metric == "geodesic" ? GraphMetric::geodesic : GraphMetric::hops;
  return result;
}

/// A capture.yaml has the key doppel_capture at the start of a line; other YAML files are calibrations.
bool is_capture_file(const fs::path& path) {
  const std::string extension = path.extension().string();
  if (extension != ".yaml" && extension != ".yml") return false;
  const std::string text = read_file(path);
  return text.compare(0, 15, "doppel_capture:") == 0 || text.find("\ndoppel_capture:") != std::string::npos;
}

Json describe_sequence(const Capture& capture, const SequenceEntry& sequence) {
  Json json;
  json["split"] = to_string(sequence.split);
  if (sequence.motion.empty()) {
    json["motion"] = "none";
    json["used"] = sequence.last_frame ? fmt::format("{} to {}", sequence.first_frame, *sequence.last_frame)
                                       : fmt::format("from {}", sequence.first_frame);
  } else {
    const long rows = describe_motion(capture.resolve(sequence.motion))["frames"];
    const long last = std::min(sequence.last_frame.value_or(rows - 1), rows - 1);
    json["motion_rows"] = rows;
    json["used"] = fmt::format("{} to {}", sequence.first_frame, last);
  }
  json["segments"] = sequence.cuts.size() + 1;
  json["masks"] = sequence.chroma_key      ? "by chroma key"
                  : sequence.subtraction   ? "by background subtraction"
                  : sequence.masks.empty() ? "none"
                                           : sequence.masks.to_string();
  json["videos"] = sequence.videos.to_string();
  if (!sequence.keypoints.empty()) json["keypoints"] = sequence.keypoints.to_string();
  if (!sequence.joints3d.empty()) json["joints3d"] = sequence.joints3d;
  return json;
}

Json describe_capture(const Capture& capture) {
  Json json;
  json["kind"] = "capture";
  json["name"] = capture.name;
  json["root"] = capture.root.string();
  json["recognised"] = capture.file.empty() ? "by its folders" : "by " + capture.file.string();
  json["prepared"] = !capture.file.empty() && fs::is_directory(capture.file.parent_path() / "store");
  json["fps"] = capture.fps;
  json["character"] = capture.character.empty() ? "none" : capture.character_path().string();
  json["cameras_in_file"] = calibrated_cameras(capture).size();
  if (!capture.cameras.empty()) json["cameras_used"] = capture.cameras;
  for (const SequenceEntry& sequence : capture.sequences)
    json["sequences"][sequence.name] = describe_sequence(capture, sequence);
  return json;
}

/// The names of some files of a folder that are described, in alphabetical order.
std::vector<std::string> described_files_in(const fs::path& folder) {
  constexpr std::size_t kShown = 8;
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && (is_described(entry.path()) || is_calibration(entry.path())))
      names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  names.resize(std::min(names.size(), kShown));
  return names;
}

Report describe_folder(const fs::path& folder, const InfoOptions& options) {
  if (fs::exists(folder / "capture.yaml")) return describe_capture(read_capture(folder));
  const fs::path character = character_of_folder(folder);
  if (!character.empty())
    return describe_character(load_character(character, character_options(options)), options.verbose);
  if (const auto recognised = recognise_capture(folder)) return describe_capture(recognised->capture);
  if (is_calibration(folder)) return report_calibration(options);
  const std::vector<std::string> files = described_files_in(folder);
  fail<UsageError>(
      "{} holds neither a capture.yaml, nor a .character file, nor the files of a calibration that is a folder, nor "
      "the "
      "folders of a dataset that is known{}",
      folder.string(), files.empty() ? "" : fmt::format("; name one of its files, such as {}", fmt::join(files, ", ")));
}

/// A template of a character; or, where it is none because it has several textures, a scan.
Json describe_obj(const fs::path& path, double metres_per_unit) {
  try {
    return with_kind("mesh", describe_mesh(read_obj(path, metres_per_unit)));
  } catch (const FileError&) {
    return describe_surface(path);
  }
}

Report describe(const fs::path& path, const InfoOptions& options) {
  if (!fs::exists(path)) fail("{} does not exist", path.string());
  if (fs::is_directory(path)) return describe_folder(path, options);
  if (is_capture_file(path)) return describe_capture(read_capture(path));
  const std::string extension = path.extension().string();
  if (extension == ".character")
    return describe_character(load_character(path, character_options(options)), options.verbose);
  if (extension == ".skeleton") return with_kind("skeleton", describe_skeleton(read_skeleton(path), options.verbose));
  if (extension == ".skin") return with_kind("skin", describe_skin(read_skin(path)));
  if (extension == ".obj") return describe_obj(path, options.metres_per_unit);
  if (extension == ".motion") return describe_motion(path);
  if (is_calibration(path)) return report_calibration(options);
  if (auto other = describe_file(path)) return *std::move(other);
  fail_at({path.string(), 0},
          "the file is none of those that `doppel info` describes: {}. A calibration has one of the formats of "
          "docs/calibration.md, keypoints one of docs/capture.md",
          described_files());
}

std::string value_text(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return fmt::format("{:.6g}", value.get<double>());
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const Json& item : value) text += (text.empty() ? "" : " ") + value_text(item);
  return text;
}

void print_lines(const Json& report, int indent) {
  for (const auto& [key, value] : report.items()) {
    std::printf("%*s%s:", indent, "", key.c_str());
    if (value.is_object()) {
      std::printf("\n");
      print_lines(value, indent + 2);
    } else {
      std::printf(" %s\n", value_text(value).c_str());
    }
  }
}

}  // namespace

Json describe_character(const Character& character, bool verbose) {
  Json json;
  json["kind"] = "character";
  json["name"] = character.name;
  json["fingerprint"] = character.fingerprint();
  json["units"] = "files in millimetres, everything below in metres";
  json["mesh"] = describe_mesh(character.mesh);
  json["skeleton"] = describe_skeleton(character.skeleton, verbose);
  json["skin"] = describe_skin(character.skin);
  json["skin"]["bone_rule"] = character.options.bone_rule == BoneRule::exact ? "exact" : "prefix";
  if (verbose)
    for (int b = 0; b < character.skin.num_bones(); ++b)
      json["skin"]["bone_joints"][character.skin.bones[b]] = character.skeleton.joints[character.bone_joint[b]].name;
  if (!character.skeleton.markers.empty()) json["markers"] = describe_markers(character);
  json["graph"] = describe_graph(character);
  json["labels"] = describe_labels(character);
  json["rest_pose_joints_off_template_m"] = skeleton_distance(character);
  return json;
}

void print_report(const Json& report, bool json) {
  if (json)
    std::printf("%s\n", report.dump(2).c_str());
  else
    print_lines(report, 0);
}

Command add_info(CLI::App& program) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* app = program.add_subcommand("info", "Describe a file, and how Doppel reads it");
  app->add_option("path", options->path,
                  "A character or a part of it, a capture, a calibration, a scan, a rigged figure, a motion, markers, "
                  "keypoints, a video, an image or an exported actor; or a folder");
  // For scripts/key_tables.sh; without a group the option is not listed.
  app->add_option("--keys", options->keys, "Print a table of the keys of a configuration")->group("");
  app->add_option("--bone-rule", options->bone_rule, "How a bone of the skinning weights finds its joint by name")
      ->check(CLI::IsMember({"exact", "prefix"}))
      ->capture_default_str();
  app->add_option("--metric", options->metric, "Distance along the template for the weights of graph nodes")
      ->check(CLI::IsMember({"hops", "geodesic"}))
      ->capture_default_str();
  app->add_option("--metres-per-unit", options->metres_per_unit, "Unit of an OBJ file that is read without a character")
      ->check(above_zero())
      ->capture_default_str();
  app->add_option("--unit", options->unit, "Unit of a calibration, if the file does not state it: m, cm or mm");
  app->add_option("--up", options->up,
                  "Axis of a calibration that points up, if the file does not state it: +x ... -z");
  app->add_option("--subject", options->subject,
                  "Subject whose cameras to describe, if the file holds those of several (default: by its folder)");
  app->add_option("--picture", options->image, "Image of a calibration's cameras from above and from the side (.png)");
  app->add_flag("--verbose", options->verbose, "List every DoF with its limits and every bone with its joint");
  app->add_flag("--versions", options->versions,
                "Describe this program instead of a file: versions, compiler, instruction set, threads")
      ->excludes("path");
  app->footer("Example: doppel info actor/actor.character --verbose");
  return {app, [options](const CommonOptions& common) {
            if (options->versions) {
              print_report(describe_versions(), common.json);
              return 0;
            }
            if (!options->keys.empty()) {
              fmt::print("{}", key_table_of(options->keys));
              return 0;
            }
            if (options->path.empty())
              fail<UsageError>("doppel info: found no path; name a file or a folder, or ask for --versions");
            const Report report = describe(options->path, *options);
            if (common.json || report.text.empty())
              print_report(report.json, common.json);
            else
              fmt::print("{}", report.text);
            return 0;
          }};
}

}  // namespace doppel::tools
