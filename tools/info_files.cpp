#include "info_files.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <opencv2/core.hpp>
#include <set>
#include <vector>

#include "doppel/actor/export/script_file.h"
#include "doppel/character/bvh.h"
#include "doppel/core/error.h"
#include "doppel/core/lower_case.h"
#include "doppel/core/npy.h"
#include "doppel/data/capture/video.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "doppel/geometry/image_file.h"
#include "doppel/io/motion_import/smpl_motion.h"
#include "doppel/io/scene/read_scene.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kFileNamesShown = 40;
constexpr std::size_t kFileValuesShown = 8;

std::string lower_extension(const fs::path& path) { return lower_case(path.extension().string()); }

/// The first names of many.
Json some_names(const std::vector<std::string>& names) {
  Json json = std::vector<std::string>(names.begin(), names.begin() + std::min(names.size(), kFileNamesShown));
  if (names.size() > kFileNamesShown) json.push_back(fmt::format("and {} more", names.size() - kFileNamesShown));
  return json;
}

Json animation_facts(const Scene& scene) {
  Json json;
  for (const SceneAnimation& animation : scene.animations)
    json[animation.name] =
        fmt::format("{:.6g} s, {} channels", animation.end - animation.start, animation.channels.size());
  return json;
}

std::vector<std::string> scene_joints(const Scene& scene) {
  std::set<int> joints;
  for (const SceneSkin& skin : scene.skins) joints.insert(skin.joints.begin(), skin.joints.end());
  std::vector<std::string> names;
  for (const int joint : joints) names.push_back(scene.nodes[joint].name);
  return names;
}

std::string surface_reader(const Scene& scene) {
  if (scene.num_faces() == 0) return "doppel animate --motion FILE";
  if (scene.skins.empty()) return "doppel character create FILE --out FOLDER";
  return scene.animations.empty() ? "doppel character import FILE --out FOLDER"
                                  : "doppel character import FILE --out FOLDER; doppel animate --motion FILE";
}

/// The box around the vertices in the rest pose, in the numbers of the file.
void add_file_size(const Scene& scene, Json& json) {
  const std::vector<Eigen::Vector3d> vertices = posed_vertices(scene, node_transforms(scene));
  if (vertices.empty()) return;
  Eigen::Vector3d low = vertices[0], high = vertices[0];
  for (const Eigen::Vector3d& vertex : vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const Eigen::Vector3d size = high - low;
  json["size_in_file"] = {size.x(), size.y(), size.z()};
}

Json bvh_facts(const fs::path& path) {
  const BvhClip clip = read_bvh(path);
  std::vector<std::string> names;
  for (const BvhJoint& joint : clip.joints)
    if (!joint.channels.empty()) names.push_back(joint.name);
  Json json;
  json["kind"] = "motion";
  json["format"] = "bvh";
  json["joints"] = names.size();
  json["frames"] = clip.frames.size();
  json["frames_per_second"] = 1.0 / clip.seconds_per_frame;
  json["seconds"] = clip.seconds_per_frame * static_cast<double>(clip.frames.size());
  json["metres_per_unit"] = clip.metres_per_unit;
  json["joint_names"] = some_names(names);
  json["read_by"] = "doppel animate --motion FILE";
  return json;
}

Json smpl_facts(const fs::path& path) {
  MotionSourceOptions options;
  const SourceMotion motion = read_smpl_motion(path, options);
  Json json;
  json["kind"] = "motion";
  json["format"] = "smpl";
  json["joints"] = motion.tracks.num_joints();
  json["frames"] = motion.tracks.num_frames();
  json["frames_per_second"] = 1.0 / motion.tracks.seconds_per_frame;
  json["seconds"] = motion.tracks.seconds_per_frame * motion.tracks.num_frames();
  if (!motion.notes.empty()) json["notes"] = motion.notes;
  if (!motion.warnings.empty()) json["warnings"] = motion.warnings;
  json["read_by"] = "doppel animate --motion FILE";
  return json;
}

/// Markers of a C3D or TRC file move a character; tables of joints are what `joints3d` names.
Json point_facts(const SpacePoints& points) {
  const bool markers = points.format == "c3d" || points.format == "trc";
  Json json;
  json["kind"] = "points in space";
  json["format"] = points.format;
  json["points"] = points.names.size();
  json["frames"] = points.frames.size();
  if (!points.frames.empty()) {
    json["first_frame"] = points.frames.begin()->first;
    json["last_frame"] = points.frames.rbegin()->first;
  }
  json["frames_per_second"] = points.rate > 0 ? Json(points.rate) : Json("not stated");
  json["unit"] = points.unit;
  std::size_t seen = 0;
  for (const auto& [frame, row] : points.frames)
    seen +=
        static_cast<std::size_t>(std::count_if(row.begin(), row.end(), [](const auto& p) { return p.has_value(); }));
  const std::size_t all = points.frames.size() * points.names.size();
  json["seen_percent"] = all > 0 ? 100.0 * static_cast<double>(seen) / static_cast<double>(all) : 0.0;
  json["point_names"] = some_names(points.names);
  json["read_by"] = markers ? "doppel animate --motion FILE" : "`joints3d` in capture.yaml";
  return json;
}

Json marker_facts(const fs::path& path) { return point_facts(read_space_points(path)); }

Json video_facts(const fs::path& path) {
  const FootageFacts facts = inspect_footage(path.string());
  Json json;
  json["kind"] = "video";
  json["width"] = facts.width;
  json["height"] = facts.height;
  json["frames_per_second"] = facts.fps > 0 ? Json(facts.fps) : Json("not stated");
  json["frames"] = facts.frames;
  if (facts.fps > 0) json["seconds"] = static_cast<double>(facts.frames) / facts.fps;
  json["read_by"] = "doppel capture init FOLDER, with the videos of the other cameras and their calibration";
  return json;
}

/// The values of an image with few of them, as masks and labels have.
std::vector<int> few_values(const cv::Mat& image) {
  std::set<int> values;
  const int channels = image.channels();
  for (int y = 0; y < image.rows && values.size() <= kFileValuesShown; ++y)
    for (int x = 0; x < image.cols * channels; ++x) values.insert(image.ptr<std::uint8_t>(y)[x]);
  return values.size() <= kFileValuesShown ? std::vector<int>(values.begin(), values.end()) : std::vector<int>();
}

Json image_facts(const fs::path& path) {
  const cv::Mat image = read_image(path);
  Json json;
  json["kind"] = "image";
  json["width"] = image.cols;
  json["height"] = image.rows;
  json["channels"] = image.channels() == 1   ? "grey"
                     : image.channels() == 3 ? "colour"
                     : image.channels() == 4 ? "colour and alpha"
                                             : std::to_string(image.channels());
  json["bits"] = 8 * image.elemSize1();
  if (image.depth() == CV_8U)
    if (const std::vector<int> values = few_values(image); !values.empty()) json["values"] = values;
  json["read_by"] = "doppel capture init FOLDER, as a frame of a camera or as a mask";
  return json;
}

Json script_facts(const fs::path& path) {
  Json json;
  ScriptFile file;
  try {
    file = load_script_file(path, ScriptKind::actor);
    json["kind"] = "actor";
    json["read_by"] = "doppel animate --model FILE; doppel view FILE";
  } catch (const FileError& not_an_actor) {
    try {
      file = load_script_file(path, ScriptKind::pose);
      json["kind"] = "pose file";
      json["read_by"] = "examples/capture_person.py";
    } catch (const FileError&) {
      throw not_an_actor;
    }
  }
  for (const auto& [key, value] : file.metadata.items()) {
    const bool is_long = value.is_array() && value.size() > kFileNamesShown;
    json[key] = is_long ? Json(fmt::format("{} entries", value.size())) : Json(value);
  }
  return json;
}

Json keypoint_facts(const fs::path& path) {
  const Detections detections = read_detections(path);
  std::size_t people = 0, points = detections.points.size();
  for (const DetectedImage& image : detections.images) {
    people = std::max(people, image.people.size());
    for (const DetectedPerson& person : image.people) points = std::max(points, person.body.size());
  }
  Json json;
  json["kind"] = "keypoints";
  json["format"] = detections.format;
  json["images"] = detections.images.size();
  json["most_people_in_one"] = people;
  json["points"] = points;
  json["unit"] = detections.unit == PointUnit::fractions ? "fractions of the image" : "pixels";
  try {
    json["layout"] = guess_layout({detections}, {path.string(), 0}).value_or("unknown: nobody was detected");
  } catch (const FileError& e) {
    json["layout"] = std::string("unknown: ") + e.what();
  }
  if (!detections.points.empty()) json["point_names"] = some_names(detections.points);
  json["read_by"] = "doppel capture init FOLDER; `keypoints` in capture.yaml";
  return json;
}

/// Of arrays, FreeMoCap's keypoints alone are read from a file: [cameras, frames, points, 2 or 3].
Json array_facts(const fs::path& path) {
  const NpyArray array = read_npy(path);
  const bool is_keypoints = array.shape.size() == 4 && (array.shape[3] == 2 || array.shape[3] == 3);
  Json json;
  json["kind"] = is_keypoints ? "keypoints" : "array";
  if (is_keypoints) json["format"] = "freemocap";
  json["shape"] = array.shape;
  if (is_keypoints) json["read_by"] = "doppel capture init FOLDER; `keypoints` in capture.yaml";
  return json;
}

Json joint_table_facts(const fs::path&) {
  return {{"kind", "joints in space"},
          {"format", "frame,index,name,x_mm,y_mm,z_mm"},
          {"read_by", "`joints3d` in capture.yaml"}};
}

/// Tables and JSON files say by their content what they are.
/// @throws FileError with the reason of each reader when they are none of them
Json facts_by_content(const fs::path& path) {
  if (is_joint_table(path)) return joint_table_facts(path);
  std::vector<std::string> reasons;
  for (const auto describe : {keypoint_facts, marker_facts}) try {
      return describe(path);
    } catch (const FileError& e) {
      reasons.emplace_back(e.what());
    }
  fail_at({path.string(), 0},
          "the file is neither a calibration (formats: docs/calibration.md) nor keypoints (docs/capture.md) nor points "
          "in space. As keypoints: {}. As points in space: {}",
          reasons[0], reasons[1]);
}

struct DescribedKind {
  const char* name;
  std::vector<std::string> extensions;
  std::function<std::optional<Json>(const fs::path&)> describe;
};

const std::vector<DescribedKind>& described_kinds() {
  static const std::vector<DescribedKind> kinds{
      {"scans and rigged figures", {".glb", ".gltf", ".vrm", ".fbx", ".dae", ".stl", ".ply"}, describe_surface},
      {"motions",
       {".bvh", ".npz"},
       [](const fs::path& path) { return lower_extension(path) == ".npz" ? smpl_facts(path) : bvh_facts(path); }},
      {"markers", {".c3d", ".trc"}, marker_facts},
      {"videos", {".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".mts", ".wmv"}, video_facts},
      {"images", {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"}, image_facts},
      {"keypoints", {".json", ".csv", ".tsv", ".txt"}, facts_by_content},
      {"arrays", {".npy"}, array_facts},
      {"exported actors", {".pt"}, script_facts}};
  return kinds;
}

/// Null where no kind has the extension.
const DescribedKind* kind_of(const fs::path& path) {
  const std::string extension = lower_extension(path);
  for (const DescribedKind& kind : described_kinds())
    if (std::find(kind.extensions.begin(), kind.extensions.end(), extension) != kind.extensions.end()) return &kind;
  return nullptr;
}

}  // namespace

Json describe_surface(const fs::path& path) {
  SceneLimits limits;
  limits.surface_needed = false;
  const Scene scene = read_scene(path, limits);
  const std::vector<std::string> joints = scene_joints(scene);
  Json json;
  json["kind"] = scene.num_faces() == 0 ? "animation" : scene.skins.empty() ? "scan" : "rigged figure";
  json["vertices"] = scene.num_vertices();
  json["triangles"] = scene.num_faces();
  json["surfaces"] = scene.primitives.size();
  json["metres_per_unit"] = scene.metres_per_unit ? Json(*scene.metres_per_unit) : Json("not stated");
  json["up"] = scene.up ? Json(std::string(1, *scene.up)) : Json("not stated");
  add_file_size(scene, json);
  for (const SceneMaterial& material : scene.materials)
    json["materials"][material.name.empty() ? "(no name)" : material.name] =
        material.texture.empty() ? std::string("a colour")
                                 : fmt::format("texture {}x{}", material.texture.cols, material.texture.rows);
  const bool colours = std::any_of(scene.primitives.begin(), scene.primitives.end(),
                                   [](const ScenePrimitive& primitive) { return !primitive.colours.empty(); });
  json["vertex_colours"] = colours;
  json["joints"] = joints.size();
  if (!joints.empty()) json["joint_names"] = some_names(joints);
  if (!scene.animations.empty()) json["animations"] = animation_facts(scene);
  if (!scene.warnings.empty()) json["warnings"] = scene.warnings;
  json["read_by"] = surface_reader(scene);
  return json;
}

std::optional<Json> describe_file(const fs::path& path) {
  const DescribedKind* const kind = kind_of(path);
  return kind ? kind->describe(path) : std::nullopt;
}

bool is_footage(const fs::path& path) {
  const DescribedKind* const kind = kind_of(path);
  return kind && (kind->name == std::string_view("videos") || kind->name == std::string_view("images"));
}

bool is_described(const fs::path& path) { return kind_of(path) != nullptr; }

std::string described_files() {
  std::string text =
      "characters and their parts (.character, .skeleton, .skin, .motion, .obj), captures (capture.yaml), calibrations";
  for (const DescribedKind& kind : described_kinds())
    text += fmt::format(", {} ({})", kind.name, fmt::join(kind.extensions, ", "));
  return text;
}

}  // namespace doppel::tools
