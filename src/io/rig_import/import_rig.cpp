#include "doppel/io/rig_import/import_rig.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "doppel/character/blend_skin.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/coarse_mesh.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/rig_import/landmarks_of_rig.h"
#include "doppel/io/rig_import/rig_frame.h"
#include "doppel/io/rig_import/rig_motion.h"
#include "doppel/io/rig_import/rig_plan.h"
#include "doppel/io/scene/scene_mesh.h"

namespace doppel {

namespace {

using Affine = Eigen::Affine3d;
using VertexWeights = std::vector<std::pair<int, double>>;  // (joint, weight), largest first

/// The animations that are not imported are sampled at this rate to learn which translations the joints need.
constexpr double kProbeRate = 60.0;
constexpr double kDensestRate = 600.0, kSparsestRate = 100.0;
constexpr double kMaxDenseFrames = 1500;

/// A name that `.skeleton` and `.skin` files can hold: without blanks, and without `_`, which ends a bone's name.
std::string bone_of(const std::string& name, std::set<std::string>& taken) {
  std::string bone;
  for (const char c : name) bone += c == '_' || static_cast<unsigned char>(c) <= ' ' || c == 127 ? '-' : c;
  std::string unique = bone;
  for (int n = 2; !taken.insert(unique).second; ++n) unique = fmt::format("{}-{}", bone, n);
  return unique;
}

/// The name of an animation as that of a file.
std::string motion_file(const std::string& animation, const std::string& character, std::set<std::string>& taken) {
  std::string stem;
  for (const char c : animation) stem += c == '/' || c == '\\' || static_cast<unsigned char>(c) < ' ' ? '_' : c;
  stem = stem.substr(0, 120);
  if (stem.empty() || stem[0] == '.' || stem == character) stem = "animation_" + stem;
  std::string unique = stem;
  for (int n = 2; !taken.insert(unique).second; ++n) unique = fmt::format("{}_{}", stem, n);
  return unique + ".motion";
}

class RigImporter {
 public:
  RigImporter(const Scene& scene, const ImportRigOptions& options)
      : scene_(scene), options_(options), plan_(plan_rig(scene)) {}

  ImportedRig import() {
    rig_.warnings = scene_.warnings;
    rig_.warnings.insert(rig_.warnings.end(), plan_.warnings.begin(), plan_.warnings.end());
    const std::vector<const SceneAnimation*> wanted = wanted_animations();
    fix_surface();
    name_joints();
    sample(wanted);
    build_character();
    for (std::size_t i = 0; i < wanted.size(); ++i) add_motion(*wanted[i], samples_[i]);
    find_body_landmarks();
    return std::move(rig_);
  }

 private:
  std::vector<const SceneAnimation*> wanted_animations() const;
  void fix_surface();
  std::vector<Eigen::Vector3d> bound_vertices(Scene& surface);
  void name_joints();
  void sample(const std::vector<const SceneAnimation*>& wanted);
  void build_character();
  void build_skin();
  void weld();
  void add_motion(const SceneAnimation& animation, const SampledAnimation& samples);
  double error_of(const SceneAnimation& animation, const ImportedMotion& motion) const;
  void find_body_landmarks();

  const Scene& scene_;
  const ImportRigOptions& options_;
  RigPlan plan_;
  ImportedRig rig_;
  Affine character_from_scene_ = Affine::Identity();
  std::vector<Eigen::Vector3d> centres_;   ///< [J] character metres
  std::vector<std::string> bones_;         ///< [J]
  std::vector<SampledAnimation> samples_;  ///< of the wanted animations, then of the others
  RigSkeleton skeleton_;
  std::vector<VertexWeights> vertex_joints_;  ///< [N] joints of the plan
};

std::vector<const SceneAnimation*> RigImporter::wanted_animations() const {
  std::vector<const SceneAnimation*> wanted;
  for (const SceneAnimation& animation : scene_.animations)
    if (options_.animations.empty() && !animation.channels.empty()) wanted.push_back(&animation);
  for (const std::string& name : options_.animations) {
    const SceneAnimation& animation = find_animation(scene_, name);
    if (animation.channels.empty())
      fail<UsageError>("the animation '{}' of the file has no keys that move a node, so there is no motion to import",
                       name);
    wanted.push_back(&animation);
  }
  return wanted;
}

/// Vertices of all parts that belong to the rig, in the bind pose and the scene's coordinates.
std::vector<Eigen::Vector3d> RigImporter::bound_vertices(Scene& surface) {
  std::vector<Eigen::Vector3d> placed;
  int first = 0;
  for (std::size_t p = 0; p < scene_.primitives.size(); ++p) {
    const ScenePrimitive& primitive = scene_.primitives[p];
    const int begin = first, part = plan_.part_joint[p];
    first += primitive.num_vertices();
    if (primitive.faces.empty() || (primitive.skin < 0 && part < 0)) continue;
    surface.primitives.push_back(primitive);
    for (int v = 0; v < primitive.num_vertices(); ++v) {
      const Eigen::Vector3d& vertex = primitive.vertices[v];
      VertexWeights row;
      if (primitive.skin < 0 || primitive.vertex_joints.size(v) == 0) {
        row.emplace_back(part, 1.0);
        placed.emplace_back(plan_.scene_from_part[p] * vertex);
      } else {
        const SceneSkin& skin = scene_.skins[primitive.skin];
        for (int i = primitive.vertex_joints.offsets[v]; i < primitive.vertex_joints.offsets[as_size(v) + 1]; ++i)
          row.emplace_back(plan_.joint_of_node(skin.joints[primitive.vertex_joints.items[i]]), primitive.weights[i]);
        placed.emplace_back(plan_.scene_from_skin[primitive.skin] * vertex);
      }
      vertex_joints_.push_back(std::move(row));
      rig_.vertex_map.push_back(begin + v);
    }
  }
  return placed;
}

void RigImporter::fix_surface() {
  Scene surface;
  surface.materials = scene_.materials;
  std::vector<Eigen::Vector3d> placed = bound_vertices(surface);
  if (placed.empty()) fail("no part of the surface hangs on the rig");
  character_from_scene_ = character_from_scene(scene_, placed, options_.metres_per_unit, options_.up, rig_.warnings);
  rig_.file_from_character = character_from_scene_.inverse();
  for (Eigen::Vector3d& vertex : placed) vertex = character_from_scene_ * vertex;
  rig_.character.mesh = scene_mesh(surface, std::move(placed));
  for (const Affine& bind : plan_.bind) centres_.push_back(character_from_scene_ * bind.translation());
}

void RigImporter::name_joints() {
  std::set<std::string> taken;
  for (int j = 0; j < plan_.num_joints(); ++j) {
    const std::string& name = scene_.nodes[plan_.nodes[j]].name;
    bones_.push_back(bone_of(name, taken));
    rig_.joints.push_back({name, bones_.back(), plan_.parents[j], centres_[j]});
  }
}

/// Also samples what is not imported, so that the skeleton is the same whichever animations are.
void RigImporter::sample(const std::vector<const SceneAnimation*>& wanted) {
  for (const SceneAnimation* animation : wanted) {
    const double rate = options_.frames_per_second > 0 ? options_.frames_per_second : sampling_rate(*animation);
    samples_.push_back(sample_animation(scene_, *animation, plan_, character_from_scene_, rate));
  }
  for (const SceneAnimation& animation : scene_.animations)
    if (!animation.channels.empty())
      samples_.push_back(sample_animation(scene_, animation, plan_, character_from_scene_, kProbeRate));
}

void RigImporter::build_skin() {
  SkinningWeights& skin = rig_.character.skin;
  std::vector<bool> used(plan_.nodes.size(), false);
  for (const VertexWeights& row : vertex_joints_)
    for (const auto& [joint, weight] : row) used[joint] = true;
  std::vector<int> bone(plan_.nodes.size(), -1);
  for (std::size_t j = 0; j < used.size(); ++j)
    if (used[j]) {
      bone[j] = skin.num_bones();
      skin.bones.push_back(bones_[j]);
    }
  for (const VertexWeights& row : vertex_joints_) {
    for (const auto& [joint, weight] : row) {
      skin.vertex_bones.items.push_back(bone[joint]);
      skin.weights.push_back(weight);
    }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
}

/// Joins vertices at one position with the same weights, such as those that a file doubles along seams of the texture.
void RigImporter::weld() {
  TriangleMesh& mesh = rig_.character.mesh;
  const auto near = [](double metres) { return std::llround(metres * 1e7); };
  std::map<std::array<long long, 3>, std::vector<int>> at;
  std::vector<int> kept, target(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d& x = mesh.vertices[v];
    std::vector<int>& here = at[{near(x.x()), near(x.y()), near(x.z())}];
    const auto same = [&](int other) {
      const VertexWeights &a = vertex_joints_[v], &b = vertex_joints_[kept[other]];
      return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const auto& p, const auto& q) {
               return p.first == q.first && std::abs(p.second - q.second) < 1e-6;
             });
    };
    const auto found = std::find_if(here.begin(), here.end(), same);
    target[v] = found == here.end() ? static_cast<int>(kept.size()) : *found;
    if (found != here.end()) continue;
    here.push_back(target[v]);
    kept.push_back(static_cast<int>(v));
  }
  const auto keep = [&](auto& values) {
    if (values.empty()) return;
    for (std::size_t i = 0; i < kept.size(); ++i) values[i] = values[kept[i]];
    values.resize(kept.size());
  };
  keep(mesh.vertices);
  keep(mesh.colours);
  keep(vertex_joints_);
  keep(rig_.vertex_map);
  for (Triangle& face : mesh.faces)
    for (int& corner : face) corner = target[corner];
}

void RigImporter::build_character() {
  Character& character = rig_.character;
  character.name = options_.name;
  character.options.num_nodes = options_.nodes;
  character.skinning = SkinningMode::linear;
  if (options_.weld) weld();
  skeleton_ = build_skeleton(plan_, bones_, centres_, samples_, options_.joint_limit);
  character.skeleton = skeleton_.skeleton;
  build_skin();
  complete_character(character);
  character.graph = build_graph(character.mesh, coarse_mesh(character.mesh, options_.nodes), character.options.graph);
}

/// The distance between the file's own skinning and the character's, at five frames.
double RigImporter::error_of(const SceneAnimation& animation, const ImportedMotion& motion) const {
  const Character& character = rig_.character;
  const int last = motion.motion.num_frames() - 1;
  double largest = 0.0;
  for (const int frame : {0, last / 4, last / 2, 3 * last / 4, last}) {
    const auto world = node_transforms(scene_, animation, motion.start + frame / motion.frames_per_second);
    const std::vector<Eigen::Vector3d> ground_truth = posed_vertices(scene_, world);
    const std::vector<Eigen::Vector3d> posed = posed_vertices(character, motion.motion.frames[frame]);
    for (std::size_t v = 0; v < posed.size(); ++v)
      largest = std::max(largest, (posed[v] - character_from_scene_ * ground_truth[rig_.vertex_map[v]]).norm());
  }
  return largest;
}

void RigImporter::add_motion(const SceneAnimation& animation, const SampledAnimation& samples) {
  ImportedMotion motion;
  motion.animation = animation.name;
  std::set<std::string> taken;
  for (const ImportedMotion& other : rig_.motions) taken.insert(std::filesystem::path(other.file).stem().string());
  motion.file = motion_file(animation.name, options_.name, taken);
  motion.frames_per_second = samples.frames_per_second;
  motion.start = samples.start;
  motion.motion = motion_of_samples(plan_, skeleton_, centres_, samples, options_.joint_limit);
  motion.error = error_of(animation, motion);
  if (motion.error > 1e-4)
    rig_.warnings.push_back(
        fmt::format("animation '{}' stretches joints, which a character's joints do not: vertices are up to {:.2g} mm "
                    "from the file's",
                    animation.name, 1000 * motion.error));
  rig_.motions.push_back(std::move(motion));
}

void RigImporter::find_body_landmarks() {
  std::vector<RigJoint> joints;
  for (const ImportedJoint& joint : rig_.joints) joints.push_back({joint.name, joint.parent, joint.position});
  const auto found = find_landmarks(joints);
  rig_.landmark_joint.assign(found.begin(), found.end());
  std::string missing;
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i] < 0) missing += std::string(missing.empty() ? "" : ", ") + kBodyLandmarks[i];
  if (!missing.empty()) rig_.warnings.push_back("the rig has no joint that is recognised as " + missing);
}

}  // namespace

double key_rate(const SceneAnimation& animation) {
  for (const double rate : {1.0, 2.0, 5.0, 10.0, 12.0, 15.0, 20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 100.0, 120.0,
                            150.0, 200.0, 240.0, 300.0}) {
    const auto has_frame = [rate](double time) { return std::abs(time * rate - std::round(time * rate)) < 1e-3; };
    bool all = std::all_of(animation.keys.begin(), animation.keys.end(), has_frame);
    if (animation.keys.empty())
      for (const SceneChannel& channel : animation.channels)
        all = all && std::all_of(channel.times.begin(), channel.times.end(), has_frame);
    if (all) return rate;
  }
  return 0.0;
}

double sampling_rate(const SceneAnimation& animation) {
  const double duration = std::max(animation.end, 1e-3);
  const double keys = key_rate(animation);
  // A rate that has a frame at the last key where the keys follow no rate.
  if (keys == 0.0) return std::max(1.0, std::round(duration * 2 * kSparsestRate)) / duration;
  double rate = keys * std::ceil(kSparsestRate / keys);
  for (double dense = kDensestRate; dense > rate; dense -= keys)
    if (std::fmod(dense, keys) == 0.0 && dense * duration <= kMaxDenseFrames) return dense;
  return rate;
}

ImportedRig import_rig(const Scene& scene, const ImportRigOptions& options) {
  check_character_name(options.name);
  return RigImporter(scene, options).import();
}

}  // namespace doppel
