#include "doppel/io/rig_import/rig_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {

namespace {

using Affine = Eigen::Affine3d;

/// Ratio of the largest to the smallest stretch above which a joint counts as sheared.
constexpr double kMaxShear = 1.05;

bool moves(const SceneNode& node, const SceneChannel& channel) {
  const Eigen::Vector4d rest =
      channel.target == SceneChannel::Target::rotation ? node.rotation.coeffs() : Eigen::Vector4d(0, 0, 0, 0);
  for (const Eigen::Vector4d& value : channel.values) {
    if (channel.interpolation == SceneChannel::Interpolation::cubic) return true;
    double change = 0.0;
    if (channel.target == SceneChannel::Target::rotation)
      change = std::min((value - rest).norm(), (value + rest).norm());
    else
      change =
          (value.head<3>() - (channel.target == SceneChannel::Target::scale ? node.scale : node.translation)).norm();
    if (change > 1e-7) return true;
  }
  return false;
}

std::vector<bool> moving_nodes(const Scene& scene) {
  std::vector<bool> moving(scene.nodes.size(), false);
  for (const SceneAnimation& animation : scene.animations)
    for (const SceneChannel& channel : animation.channels)
      if (moves(scene.nodes[channel.node], channel)) moving[channel.node] = true;
  return moving;
}

/// Whether a primitive has vertices that follow its node.
bool has_loose_vertices(const ScenePrimitive& primitive) {
  if (primitive.skin < 0) return true;
  for (int v = 0; v < primitive.num_vertices(); ++v)
    if (primitive.vertex_joints.size(v) == 0) return true;
  return false;
}

class Planner {
 public:
  explicit Planner(const Scene& scene)
      : scene_(scene),
        rest_(node_transforms(scene)),
        moving_(moving_nodes(scene)),
        chosen_(scene.nodes.size(), false) {}

  RigPlan plan() {
    choose_skin_joints();
    choose_parts();
    choose_nodes_between();
    choose_root();
    order_joints();
    find_bind_poses();
    bind_parts();
    check_rest();
    return std::move(plan_);
  }

 private:
  void choose_skin_joints();
  void choose_parts();
  void choose_nodes_between();
  void choose_root();
  void order_joints();
  void find_bind_poses();
  Affine bind_of_skin(const SceneSkin& skin) const;
  void bind_parts();
  void check_rest();
  int parent(int node) const { return scene_.nodes[node].parent; }
  /// The nearest chosen node from `node` upwards, or -1.
  int carrier(int node) const {
    while (node >= 0 && !chosen_[node]) node = parent(node);
    return node;
  }
  int depth(int node) const {
    int count = 0;
    for (; node >= 0; node = parent(node)) ++count;
    return count;
  }

  const Scene& scene_;
  std::vector<Affine> rest_;
  std::vector<bool> moving_, chosen_;
  std::map<int, int> joint_of_node_;
  RigPlan plan_;
};

void Planner::choose_skin_joints() {
  bool any = false;
  for (const ScenePrimitive& primitive : scene_.primitives) {
    if (primitive.skin < 0 || primitive.faces.empty()) continue;
    any = true;
    for (const int node : scene_.skins[primitive.skin].joints) chosen_[node] = true;
  }
  if (!any)
    fail(
        "the file has {} nodes and {} vertices, but no surface with a skin, so there is no rig to import; "
        "`doppel character create` rigs a surface without one",
        scene_.nodes.size(), scene_.num_vertices());
}

/// A part without a skin hangs on the joint above it. If something in between moves, the part's node is a joint too.
void Planner::choose_parts() {
  for (const ScenePrimitive& primitive : scene_.primitives) {
    if (primitive.faces.empty() || !has_loose_vertices(primitive)) continue;
    const int joint = carrier(primitive.node);
    if (joint < 0) continue;
    for (int node = primitive.node; node != joint; node = parent(node))
      if (moving_[node]) {
        chosen_[primitive.node] = true;
        break;
      }
  }
}

void Planner::choose_nodes_between() {
  for (std::size_t i = 0; i < scene_.nodes.size(); ++i) {
    if (!chosen_[i]) continue;
    const int above = parent(static_cast<int>(i)) < 0 ? -1 : carrier(parent(static_cast<int>(i)));
    if (above < 0) continue;
    for (int node = parent(static_cast<int>(i)); node != above; node = parent(node)) chosen_[node] = true;
  }
}

void Planner::choose_root() {
  std::vector<int> tops;
  for (std::size_t i = 0; i < scene_.nodes.size(); ++i)
    if (chosen_[i] && (scene_.nodes[i].parent < 0 || carrier(scene_.nodes[i].parent) < 0))
      tops.push_back(static_cast<int>(i));
  if (tops.size() < 2) return;
  int common = tops[0];
  for (const int top : tops) {
    int other = top;
    while (common != other && common >= 0 && other >= 0) {
      if (depth(common) >= depth(other))
        common = parent(common);
      else
        other = parent(other);
    }
    if (common != other) common = -1;
    if (common < 0)
      fail("the joints '{}' and '{}' have no common node above them; a character has one root. Put both below one node",
           scene_.nodes[tops[0]].name, scene_.nodes[top].name);
  }
  chosen_[common] = true;
  choose_nodes_between();
  plan_.warnings.push_back(fmt::format("the rig has {} topmost joints; '{}' above them is the root", tops.size(),
                                       scene_.nodes[common].name));
}

/// Parents first, otherwise in the order of the file.
void Planner::order_joints() {
  std::vector<std::pair<int, int>> order;
  for (std::size_t i = 0; i < scene_.nodes.size(); ++i)
    if (chosen_[i]) order.emplace_back(depth(static_cast<int>(i)), static_cast<int>(i));
  std::sort(order.begin(), order.end());
  for (const auto& [depth, node] : order) {
    const int above = parent(node) < 0 ? -1 : carrier(parent(node));
    joint_of_node_[node] = plan_.num_joints();
    plan_.nodes.push_back(node);
    plan_.parents.push_back(above < 0 ? -1 : joint_of_node_.at(above));
  }
}

/// The first of the matrices that agree with most others; a difference of 1e-4 of the largest entry is none.
/// @param candidates indices into `matrices`, at least one; on return those that agree with the chosen one
template <typename Matrix>
std::size_t most_agreed(const std::vector<Matrix>& matrices, std::vector<std::size_t>& candidates) {
  std::vector<std::size_t> best;
  for (const std::size_t a : candidates) {
    const double tolerance = 1e-4 * std::max(matrices[a].cwiseAbs().maxCoeff(), 1e-12);
    std::vector<std::size_t> agreeing;
    for (const std::size_t b : candidates)
      if ((matrices[b] - matrices[a]).cwiseAbs().maxCoeff() < tolerance) agreeing.push_back(b);
    if (agreeing.size() > best.size()) best = std::move(agreeing);
  }
  candidates = best;
  return candidates.front();
}

/// The position of a skin's vertices for which most joints keep them as they are in the rest pose. Where the rest pose
/// is another pose, few joints agree in all. Then the trunk and the joints that stand as it does agree at least in
/// their directions, and outvote the bones of a hand.
Affine Planner::bind_of_skin(const SceneSkin& skin) const {
  if (skin.bind_transform) return *skin.bind_transform;
  std::vector<Affine> transforms;
  std::vector<Eigen::Matrix3d> directions;
  std::vector<Eigen::Matrix4d> matrices;
  std::vector<std::size_t> candidates;
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    transforms.push_back(rest_[skin.joints[j]] * skin.joint_from_mesh[j]);
    directions.emplace_back(transforms[j].linear());
    matrices.push_back(transforms[j].matrix());
    candidates.push_back(j);
  }
  most_agreed(directions, candidates);
  return transforms[most_agreed(matrices, candidates)];
}

void Planner::find_bind_poses() {
  plan_.scene_from_skin.assign(scene_.skins.size(), Affine::Identity());
  plan_.bind.assign(plan_.nodes.size(), Affine::Identity());
  std::vector<bool> known(plan_.nodes.size(), false);
  for (const ScenePrimitive& primitive : scene_.primitives) {
    if (primitive.skin < 0 || primitive.faces.empty()) continue;
    const SceneSkin& skin = scene_.skins[primitive.skin];
    Affine transform = bind_of_skin(skin);
    // A second skin stands where it makes the joints that both have coincide.
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      if (const auto joint = as_size(joint_of_node_.at(skin.joints[j])); known[joint]) {
        transform = plan_.bind[joint] * skin.joint_from_mesh[j];
        break;
      }
    plan_.scene_from_skin[primitive.skin] = transform;
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      const auto joint = as_size(joint_of_node_.at(skin.joints[j]));
      if (known[joint]) continue;
      if (!(std::abs(skin.joint_from_mesh[j].linear().determinant()) > 1e-30))
        fail("the inverse bind matrix of joint '{}' is singular, so the joint has no bind pose",
             scene_.nodes[skin.joints[j]].name);
      plan_.bind[joint] = transform * skin.joint_from_mesh[j].inverse();
      known[joint] = true;
    }
  }
  for (int j = 0; j < plan_.num_joints(); ++j) {
    if (known[j]) continue;
    const int above = plan_.parents[j];
    const Affine& rest = rest_[plan_.nodes[j]];
    if (above < 0) {
      plan_.bind[j] = rest;
      continue;
    }
    const Affine& rest_above = rest_[plan_.nodes[above]];
    plan_.bind[j] = plan_.bind[above] * rest_above.inverse() * rest;
  }
}

void Planner::bind_parts() {
  for (const ScenePrimitive& primitive : scene_.primitives) {
    const int node = primitive.faces.empty() ? -1 : carrier(primitive.node);
    const bool loose = !primitive.faces.empty() && has_loose_vertices(primitive);
    int joint = node < 0 ? -1 : joint_of_node_.at(node);
    // Vertices without weights in a skinned mesh beside the rig follow the root.
    if (loose && joint < 0 && primitive.skin >= 0) joint = 0;
    plan_.part_joint.push_back(loose ? joint : -1);
    Affine transform = Affine::Identity();
    if (loose && joint >= 0) {
      const Affine& rest_joint = rest_[plan_.nodes[joint]];
      transform = plan_.bind[joint] * rest_joint.inverse() * rest_[primitive.node];
    }
    plan_.scene_from_part.push_back(transform);
    if (loose && joint < 0)
      plan_.warnings.push_back(fmt::format("'{}' (node '{}') hangs on no joint and is left out", primitive.name,
                                           scene_.nodes[primitive.node].name));
  }
}

/// A skeleton turns and moves its joints. What stretches them evenly is dropped with a warning, the rest is refused.
void Planner::check_rest() {
  double farthest = 0.0;
  std::string worst;
  for (int j = 0; j < plan_.num_joints(); ++j) {
    const int node = plan_.nodes[j];
    const std::string& name = scene_.nodes[node].name;
    if (!(std::abs(plan_.bind[j].linear().determinant()) > 1e-30))
      fail("joint '{}' has the scale 0 in its bind pose; give it a scale of 1", name);
    const Eigen::Matrix3d change = (rest_[node] * plan_.bind[j].inverse()).linear();
    const Eigen::Vector3d stretch = svd(change).values;
    if (change.determinant() < 0)
      fail(
          "joint '{}' is mirrored (negative scale) against its bind pose; apply the scale in the program that made "
          "the file, and export it again",
          name);
    if (!(stretch[0] <= kMaxShear * stretch[2]))
      fail(
          "joint '{}' is sheared against its bind pose (stretched by {:.3g} and {:.3g} in two directions); apply the "
          "scale in the program that made the file, and export it again",
          name, stretch[0], stretch[2]);
    const double off = std::max(std::abs(stretch[0] - 1), std::abs(stretch[2] - 1));
    if (off > farthest) {
      farthest = off;
      worst = name;
    }
  }
  if (farthest > 1e-3)
    plan_.warnings.push_back(
        fmt::format("joint '{}' is scaled by {:.1f} % against its bind pose; joints of a character keep their size",
                    worst, 100 * farthest));
}

}  // namespace

int RigPlan::joint_of_node(int node) const {
  const auto found = std::find(nodes.begin(), nodes.end(), node);
  return found == nodes.end() ? -1 : static_cast<int>(found - nodes.begin());
}

RigPlan plan_rig(const Scene& scene) { return Planner(scene).plan(); }

JointPose joint_pose(const Affine& motion, const Eigen::Vector3d& centre) {
  Svd3 parts = svd(motion.linear());
  Eigen::Matrix3d turn = parts.U * parts.V.transpose();
  if (turn.determinant() < 0) {
    parts.U.col(2) *= -1;
    turn = parts.U * parts.V.transpose();
  }
  return {Eigen::Quaterniond(turn), motion * centre};
}

}  // namespace doppel
