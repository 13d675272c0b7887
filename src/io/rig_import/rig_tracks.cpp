#include "doppel/io/rig_import/rig_tracks.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/rig_frame.h"
#include "doppel/io/rig_import/rig_motion.h"
#include "doppel/io/rig_import/rig_plan.h"

namespace doppel {

namespace {

constexpr double kSlowestTracks = 24.0, kTracksWithoutRate = 30.0;
constexpr double kMaxTrackedPoses = 2e7;

const SceneAnimation& chosen_animation(const Scene& scene, const std::string& name) {
  if (!name.empty()) return find_animation(scene, name);
  const SceneAnimation* chosen = nullptr;
  std::string names;
  int count = 0;
  for (const SceneAnimation& animation : scene.animations) {
    if (animation.channels.empty()) continue;
    chosen = &animation;
    names += (count++ == 0 ? "'" : ", '") + animation.name + "'";
  }
  if (!chosen) fail<UsageError>("the file has no animation, so there is no motion in it");
  if (count > 1) fail<UsageError>("the file has {} animations; choose one by its name: {}", count, excerpt(names, 500));
  return *chosen;
}

bool has_skinned_surface(const Scene& scene) {
  return std::any_of(scene.primitives.begin(), scene.primitives.end(),
                     [](const ScenePrimitive& primitive) { return primitive.skin >= 0 && !primitive.faces.empty(); });
}

/// All nodes as joints, parents first, as they stand without animation.
RigPlan plan_of_nodes(const Scene& scene) {
  RigPlan plan;
  const std::vector<Eigen::Affine3d> rest = node_transforms(scene);
  std::vector<int> joint_of(scene.nodes.size(), -1);
  for (std::size_t i = 0; i < scene.nodes.size(); ++i) {
    std::vector<int> way;  // from the node up to what is placed already
    for (int node = static_cast<int>(i); node >= 0 && joint_of[node] < 0; node = scene.nodes[node].parent)
      way.push_back(node);
    for (; !way.empty(); way.pop_back()) {
      const auto node = as_size(way.back());
      const int above = scene.nodes[node].parent;
      joint_of[node] = plan.num_joints();
      plan.nodes.push_back(way.back());
      plan.parents.push_back(above < 0 ? -1 : joint_of[above]);
      plan.bind.push_back(rest[node]);
      // A hidden node may have the scale 0, from which no rotation follows.
      if (!(std::abs(rest[node].linear().determinant()) > 1e-30)) plan.bind.back().linear().setIdentity();
    }
  }
  return plan;
}

double rate_of_tracks(const SceneAnimation& animation, double wanted) {
  if (wanted > 0) return wanted;
  const double keys = key_rate(animation);
  return keys > 0 ? keys * std::ceil(kSlowestTracks / keys) : kTracksWithoutRate;
}

}  // namespace

RigTracks rig_tracks(const Scene& scene, const RigTracksOptions& options) {
  const SceneAnimation& animation = chosen_animation(scene, options.animation);
  const RigPlan plan = has_skinned_surface(scene) ? plan_rig(scene) : plan_of_nodes(scene);
  RigTracks result;
  result.animation = animation.name;
  result.warnings = scene.warnings;
  result.warnings.insert(result.warnings.end(), plan.warnings.begin(), plan.warnings.end());
  std::vector<Eigen::Vector3d> positions;
  for (const Eigen::Affine3d& bind : plan.bind) positions.push_back(bind.translation());
  const Eigen::Affine3d frame =
      character_from_scene(scene, positions, options.metres_per_unit, options.up, result.warnings);
  const double rate = rate_of_tracks(animation, options.frames_per_second);
  const double duration = animation.end - std::min(animation.start, 0.0);
  if (!((duration * rate + 1) * plan.num_joints() <= kMaxTrackedPoses))
    fail("the animation '{}' lasts {:.4g} s; {} joints at {:.4g} frames per second are more than is read",
         animation.name, duration, plan.num_joints(), rate);
  JointTracks& tracks = result.tracks;
  for (int j = 0; j < plan.num_joints(); ++j) {
    tracks.names.push_back(scene.nodes[plan.nodes[j]].name);
    tracks.rest.emplace_back(Eigen::Translation3d(frame * positions[j]));
  }
  tracks.parents = plan.parents;
  tracks.seconds_per_frame = 1.0 / rate;
  for (const auto& poses : sample_animation(scene, animation, plan, frame, rate).frames) {
    auto& joints = tracks.frames.emplace_back();
    for (const JointPose& pose : poses) joints.push_back(Eigen::Translation3d(pose.position) * pose.rotation);
  }
  return result;
}

}  // namespace doppel
