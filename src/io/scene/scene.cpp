#include "doppel/io/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

using Affine = Eigen::Affine3d;

Affine local_transform(const SceneNode& node) {
  Affine transform = Eigen::Translation3d(node.translation) * node.before;
  transform = transform * node.rotation * node.between;
  return transform * Eigen::Scaling(node.scale) * node.after;
}

/// World transforms of nodes in any order. A reader has made sure that there is no circle.
std::vector<Affine> world_transforms(const std::vector<SceneNode>& nodes) {
  std::vector<Affine> world(nodes.size());
  std::vector<bool> known(nodes.size(), false);
  std::vector<int> chain;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (int n = static_cast<int>(i); n >= 0 && !known[n]; n = nodes[n].parent) chain.push_back(n);
    for (; !chain.empty(); chain.pop_back()) {
      const auto n = as_size(chain.back());
      const Affine local = local_transform(nodes[n]);
      world[n] = nodes[n].parent < 0 ? local : world[nodes[n].parent] * local;
      known[n] = true;
    }
  }
  return world;
}

Eigen::Quaterniond to_rotation(const Eigen::Vector4d& value) {
  const Eigen::Quaterniond rotation(value[3], value[0], value[1], value[2]);
  return rotation.norm() > 0 ? rotation.normalized() : Eigen::Quaterniond::Identity();
}

/// Between key `k` and the next, `part` of the way.
Eigen::Vector4d interpolate(const SceneChannel& channel, std::size_t k, double part) {
  const auto& v = channel.values;
  if (channel.interpolation == SceneChannel::Interpolation::cubic) {
    const double s = part, s2 = s * s, s3 = s2 * s, gap = channel.times[k + 1] - channel.times[k];
    return (2 * s3 - 3 * s2 + 1) * v[3 * k + 1] + gap * (s3 - 2 * s2 + s) * v[3 * k + 2] +
           (3 * s2 - 2 * s3) * v[3 * k + 4] + gap * (s3 - s2) * v[3 * k + 3];
  }
  if (channel.interpolation == SceneChannel::Interpolation::step) return v[k];
  if (channel.target == SceneChannel::Target::rotation)
    return to_rotation(v[k]).slerp(part, to_rotation(v[k + 1])).coeffs();
  return (1 - part) * v[k] + part * v[k + 1];
}

Eigen::Vector4d value_at(const SceneChannel& channel, double seconds) {
  const auto& times = channel.times;
  const bool cubic = channel.interpolation == SceneChannel::Interpolation::cubic;
  const auto key = [&](std::size_t k) { return channel.values[cubic ? 3 * k + 1 : k]; };
  const auto next = std::upper_bound(times.begin(), times.end(), seconds);
  if (next == times.begin()) return key(0);
  if (next == times.end()) return key(times.size() - 1);
  const auto k = as_size(next - times.begin() - 1);
  return interpolate(channel, k, (seconds - times[k]) / (times[k + 1] - times[k]));
}

}  // namespace

int Scene::num_vertices() const {
  int count = 0;
  for (const ScenePrimitive& primitive : primitives) count += primitive.num_vertices();
  return count;
}

int Scene::num_faces() const {
  int count = 0;
  for (const ScenePrimitive& primitive : primitives) count += static_cast<int>(primitive.faces.size());
  return count;
}

cv::Mat coloured_texture(const SceneMaterial& material) {
  if (material.texture.empty() || material.colour.head<3>() == Eigen::Vector3d::Ones()) return material.texture;
  const Eigen::Vector4d& rgb = material.colour;
  cv::Mat result;
  cv::multiply(material.texture, cv::Scalar(rgb[2], rgb[1], rgb[0]), result);
  return result;
}

std::vector<Affine> node_transforms(const Scene& scene) { return world_transforms(scene.nodes); }

std::vector<Affine> node_transforms(const Scene& scene, const SceneAnimation& animation, double seconds) {
  std::vector<SceneNode> nodes = scene.nodes;
  for (const SceneChannel& channel : animation.channels) {
    if (channel.times.empty()) continue;
    const Eigen::Vector4d value = value_at(channel, seconds);
    SceneNode& node = nodes[channel.node];
    if (channel.target == SceneChannel::Target::rotation)
      node.rotation = to_rotation(value);
    else
      (channel.target == SceneChannel::Target::scale ? node.scale : node.translation) = value.head<3>();
  }
  return world_transforms(nodes);
}

std::vector<Eigen::Vector3d> posed_vertices(const Scene& scene, const ScenePrimitive& primitive,
                                            const std::vector<Affine>& world_from_node) {
  const Affine& own = world_from_node[primitive.node];
  std::vector<Affine> world_from_mesh;
  if (primitive.skin >= 0) {
    const SceneSkin& skin = scene.skins[primitive.skin];
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      world_from_mesh.push_back(world_from_node[skin.joints[j]] * skin.joint_from_mesh[j]);
  }
  std::vector<Eigen::Vector3d> posed;
  posed.reserve(primitive.vertices.size());
  for (int v = 0; v < primitive.num_vertices(); ++v) {
    const Eigen::Vector3d& rest = primitive.vertices[v];
    if (primitive.skin < 0 || primitive.vertex_joints.size(v) == 0) {
      posed.emplace_back(own * rest);
      continue;
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = primitive.vertex_joints.offsets[v]; i < primitive.vertex_joints.offsets[as_size(v) + 1]; ++i)
      sum += primitive.weights[i] * (world_from_mesh[primitive.vertex_joints.items[i]] * rest);
    posed.push_back(sum);
  }
  return posed;
}

std::vector<Eigen::Vector3d> posed_vertices(const Scene& scene, const std::vector<Affine>& world_from_node) {
  std::vector<Eigen::Vector3d> all;
  for (const ScenePrimitive& primitive : scene.primitives) {
    const std::vector<Eigen::Vector3d> part = posed_vertices(scene, primitive, world_from_node);
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace doppel
