#include "doppel/io/scene/finish_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// Gives each item its name: the file's, numbered where it occurs twice, or `<fallback>_<index>`.
class UniqueNames {
 public:
  std::string of(const std::string& wanted, const std::string& fallback, std::size_t index) {
    const std::string base = wanted.empty() ? fallback + "_" + std::to_string(index) : wanted;
    std::string name = base;
    // The next number of a name is remembered: a file may give one name to all its nodes.
    for (int& n = next_.try_emplace(base, 2).first->second; !taken_.insert(name).second; ++n)
      name = base + "_" + std::to_string(n);
    return name;
  }

 private:
  std::set<std::string> taken_;
  std::map<std::string, int> next_;
};

void name_nodes(Scene& scene) {
  std::vector<bool> joint(scene.nodes.size(), false);
  for (const SceneSkin& skin : scene.skins)
    for (const int node : skin.joints) joint[node] = true;
  UniqueNames names;
  // Joints first: of a joint and a mesh with the same name, the joint keeps it.
  for (const bool joints : {true, false})
    for (std::size_t i = 0; i < scene.nodes.size(); ++i)
      if (joint[i] == joints) scene.nodes[i].name = names.of(scene.nodes[i].name, "node", i);
  UniqueNames animations;
  for (std::size_t i = 0; i < scene.animations.size(); ++i)
    scene.animations[i].name = animations.of(scene.animations[i].name, "animation", i);
}

void check_materials(ScenePrimitive& primitive, std::size_t count) {
  const auto bounded = [&](int material) { return material >= 0 && as_size(material) < count ? material : -1; };
  primitive.material = bounded(primitive.material);
  for (int& material : primitive.face_materials) material = bounded(material);
}

bool is_finite(const Eigen::Affine3d& transform) { return transform.matrix().allFinite(); }

void check_nodes(const FileLocation& where, const Scene& scene) {
  for (std::size_t i = 0; i < scene.nodes.size(); ++i) {
    const SceneNode& node = scene.nodes[i];
    if (!node.translation.allFinite() || !node.rotation.coeffs().allFinite() || !node.scale.allFinite() ||
        !is_finite(node.before) || !is_finite(node.between) || !is_finite(node.after))
      fail_at(where, "the transform of node {} ('{}') holds a number that is not finite", i, node.name);
  }
  const int count = static_cast<int>(scene.nodes.size());
  for (std::size_t s = 0; s < scene.skins.size(); ++s) {
    const SceneSkin& skin = scene.skins[s];
    if (skin.joints.size() != skin.joint_from_mesh.size())
      fail_at(where, "skin {} has {} joints but {} inverse bind matrices", s, skin.joints.size(),
              skin.joint_from_mesh.size());
    for (std::size_t j = 0; j < skin.joints.size(); ++j) {
      if (skin.joints[j] < 0 || skin.joints[j] >= count)
        fail_at(where, "skin {} names node {} as a joint, but the file has {} nodes", s, skin.joints[j], count);
      if (!is_finite(skin.joint_from_mesh[j]))
        fail_at(where, "the inverse bind matrix of joint {} of skin {} holds a number that is not finite", j, s);
    }
  }
}

void check_faces(const FileLocation& where, const ScenePrimitive& primitive, std::size_t index) {
  const int n = primitive.num_vertices(), uvs = static_cast<int>(primitive.uvs.size());
  for (std::size_t f = 0; f < primitive.faces.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const int vertex = primitive.faces[f][c];
      if (vertex < 0 || vertex >= n)
        fail_at(where, "triangle {} of primitive {} ('{}') names vertex {}, but there are {}", f, index, primitive.name,
                vertex, n);
      if (!primitive.face_uvs.empty() && (primitive.face_uvs[f][c] < 0 || primitive.face_uvs[f][c] >= uvs))
        fail_at(where, "triangle {} of primitive {} ('{}') names UV {}, but there are {}", f, index, primitive.name,
                primitive.face_uvs[f][c], uvs);
    }
}

void check_primitive(const FileLocation& where, const Scene& scene, const ScenePrimitive& primitive,
                     std::size_t index) {
  for (std::size_t v = 0; v < primitive.vertices.size(); ++v)
    if (!primitive.vertices[v].allFinite())
      fail_at(where, "vertex {} of primitive {} ('{}') has a position that is not finite", v, index, primitive.name);
  check_faces(where, primitive, index);
  if (primitive.node < 0 || as_size(primitive.node) >= scene.nodes.size())
    fail_at(where, "primitive {} is placed by node {}, but the file has {} nodes", index, primitive.node,
            scene.nodes.size());
  if (primitive.skin >= static_cast<int>(scene.skins.size()))
    fail_at(where, "primitive {} names skin {}, but the file has {}", index, primitive.skin, scene.skins.size());
  if (primitive.skin < 0) return;
  const int joints = static_cast<int>(scene.skins[primitive.skin].joints.size());
  for (const int joint : primitive.vertex_joints.items)
    if (joint < 0 || joint >= joints)
      fail_at(where, "primitive {} ('{}') has a weight for joint {}, but its skin has {} joints", index, primitive.name,
              joint, joints);
}

/// UVs that are not finite would spoil an atlas; they are set to 0.
void mend_uvs(Scene& scene) {
  long mended = 0;
  for (ScenePrimitive& primitive : scene.primitives)
    for (Eigen::Vector2d& uv : primitive.uvs)
      if (!uv.allFinite()) {
        uv.setZero();
        ++mended;
      }
  if (mended > 0) scene.warnings.push_back(fmt::format("{} texture coordinates were not finite and are now 0", mended));
}

void check_channel(const FileLocation& where, const Scene& scene, const SceneAnimation& animation,
                   const SceneChannel& channel) {
  const bool cubic = channel.interpolation == SceneChannel::Interpolation::cubic;
  if (channel.node < 0 || as_size(channel.node) >= scene.nodes.size())
    fail_at(where, "animation '{}' moves node {}, but the file has {} nodes", animation.name, channel.node,
            scene.nodes.size());
  if (channel.values.size() != channel.times.size() * (cubic ? 3 : 1))
    fail_at(where, "animation '{}' has {} times but {} values for node '{}'", animation.name, channel.times.size(),
            channel.values.size(), scene.nodes[channel.node].name);
  for (std::size_t k = 0; k < channel.times.size(); ++k)
    if (!std::isfinite(channel.times[k]) || (k > 0 && channel.times[k] <= channel.times[k - 1]))
      fail_at(where, "animation '{}': the time of key {} of node '{}' is {}, not after that of the key before",
              animation.name, k, scene.nodes[channel.node].name, channel.times[k]);
  for (const Eigen::Vector4d& value : channel.values)
    if (!value.allFinite())
      fail_at(where, "animation '{}' has a value that is not finite for node '{}'", animation.name,
              scene.nodes[channel.node].name);
}

void check_animations(const FileLocation& where, Scene& scene) {
  for (SceneAnimation& animation : scene.animations) {
    animation.channels.erase(std::remove_if(animation.channels.begin(), animation.channels.end(),
                                            [](const SceneChannel& channel) { return channel.times.empty(); }),
                             animation.channels.end());
    bool first = true;
    for (const SceneChannel& channel : animation.channels) {
      check_channel(where, scene, animation, channel);
      animation.start = first ? channel.times.front() : std::min(animation.start, channel.times.front());
      animation.end = first ? channel.times.back() : std::max(animation.end, channel.times.back());
      first = false;
    }
  }
}

void check_counts(const FileLocation& where, const Scene& scene, const SceneLimits& limits) {
  std::int64_t vertices = 0, faces = 0;
  for (const ScenePrimitive& primitive : scene.primitives) {
    vertices += primitive.num_vertices();
    faces += static_cast<std::int64_t>(primitive.faces.size());
  }
  if (faces == 0 && limits.surface_needed)
    fail_at(where, "the file holds no triangles, so there is no surface to read");
  if (vertices > limits.vertices || faces > limits.triangles)
    fail_at(where, "the file has {} vertices and {} triangles; at most {} and {} are read", vertices, faces,
            limits.vertices, limits.triangles);
  if (scene.primitives.size() > as_size(limits.nodes))
    fail_at(where, "the file has {} surfaces; at most {} are read", scene.primitives.size(), limits.nodes);
  if (scene.nodes.size() > as_size(limits.nodes))
    fail_at(where, "the file has {} nodes; at most {} are read", scene.nodes.size(), limits.nodes);
}

/// Whether the rest pose mirrors what hangs on a transform.
bool mirrors(const Eigen::Affine3d& transform) { return transform.linear().determinant() < 0.0; }

/// Turns the triangles over that a mirroring transform has turned inside out, as glTF demands and other programs do.
/// A vertex with weights follows the joint with the largest one, the others follow the node.
void orient_faces(Scene& scene) {
  const std::vector<Eigen::Affine3d> world_from_node = node_transforms(scene);
  std::vector<std::vector<bool>> joint_mirrors;  // of each skin
  for (const SceneSkin& skin : scene.skins) {
    std::vector<bool>& joints = joint_mirrors.emplace_back();
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      joints.push_back(mirrors(world_from_node[skin.joints[j]] * skin.joint_from_mesh[j]));
  }
  for (ScenePrimitive& primitive : scene.primitives) {
    const bool node_mirrors = mirrors(world_from_node[primitive.node]);
    const auto is_mirrored = [&](int vertex) {
      const bool follows_node = primitive.skin < 0 || primitive.vertex_joints.size(vertex) == 0;
      if (follows_node) return node_mirrors;
      return static_cast<bool>(
          joint_mirrors[primitive.skin][primitive.vertex_joints.items[primitive.vertex_joints.offsets[vertex]]]);
    };
    for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
      Triangle& face = primitive.faces[f];
      if (std::count_if(face.begin(), face.end(), is_mirrored) < 2) continue;
      std::swap(face[1], face[2]);
      if (!primitive.face_uvs.empty()) std::swap(primitive.face_uvs[f][1], primitive.face_uvs[f][2]);
    }
  }
}

/// Colours that are not finite are grey. Some scanners write 0..255 where the format means 0..1.
void mend_colours(Scene& scene) {
  long mended = 0;
  for (ScenePrimitive& primitive : scene.primitives) {
    double largest = 0.0;
    for (Eigen::Vector3d& colour : primitive.colours) {
      if (!colour.allFinite()) {
        colour.setConstant(0.8);
        ++mended;
      }
      largest = std::max(largest, colour.maxCoeff());
    }
    const double full = largest > 2.0 && largest <= 255.0 ? 255.0 : 1.0;
    for (Eigen::Vector3d& colour : primitive.colours) colour = (colour / full).cwiseMax(0.0).cwiseMin(1.0);
  }
  if (mended > 0)
    scene.warnings.push_back(fmt::format("{} colours of vertices were not finite and are now grey", mended));
  for (SceneMaterial& material : scene.materials) {
    if (!material.colour.allFinite()) material.colour.setOnes();
    material.colour = material.colour.cwiseMax(0.0).cwiseMin(1.0);
  }
}

}  // namespace

bool append_weights(ScenePrimitive& primitive, JointWeights row) {
  std::sort(row.begin(), row.end());
  JointWeights merged;
  double sum = 0.0;
  for (const auto& [joint, weight] : row) {
    if (!(weight >= 0.0) || !std::isfinite(weight)) fail("a skinning weight is {}; weights are not negative", weight);
    if (weight == 0.0) continue;
    sum += weight;
    if (!merged.empty() && merged.back().first == joint)
      merged.back().second += weight;
    else
      merged.emplace_back(joint, weight);
  }
  std::stable_sort(merged.begin(), merged.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  for (const auto& [joint, weight] : merged) {
    primitive.vertex_joints.items.push_back(joint);
    primitive.weights.push_back(weight / sum);
  }
  primitive.vertex_joints.offsets.push_back(static_cast<int>(primitive.vertex_joints.items.size()));
  return std::abs(sum - 1.0) <= 1e-3;
}

void check_tree(const fs::path& path, const std::vector<SceneNode>& nodes) {
  const FileLocation where{path.string(), 0};
  const int count = static_cast<int>(nodes.size());
  std::vector<int> state(nodes.size(), 0);  // the walk that has reached the node; 0: none
  for (int i = 0; i < count; ++i) {
    for (int n = i; n >= 0 && state[n] == 0; n = nodes[n].parent) {
      state[n] = i + 1;
      const int parent = nodes[n].parent;
      if (parent >= count || parent < -1)
        fail_at(where, "node {} has the parent {}, but the file has {} nodes", n, parent, count);
      if (parent >= 0 && state[parent] == i + 1)
        fail_at(where, "the parents of node {} ('{}') form a circle that never reaches a root", n, nodes[n].name);
    }
  }
}

void complete_face_uvs(ScenePrimitive& primitive) {
  const int none = static_cast<int>(primitive.uvs.size());
  bool missing = false;
  for (Triangle& face : primitive.face_uvs)
    if (face[0] < 0) {
      face = {none, none, none};
      missing = true;
    }
  if (missing) primitive.uvs.emplace_back(0.0, 0.0);
}

void single_material(ScenePrimitive& primitive) {
  const std::vector<int>& materials = primitive.face_materials;
  primitive.material = materials.empty() ? -1 : materials[0];
  if (std::all_of(materials.begin(), materials.end(), [&](int m) { return m == primitive.material; }))
    primitive.face_materials.clear();
}

void finish_scene(const fs::path& path, Scene& scene, const SceneLimits& limits) {
  const FileLocation where{path.string(), 0};
  check_counts(where, scene, limits);
  check_tree(path, scene.nodes);
  check_nodes(where, scene);
  name_nodes(scene);
  std::stable_sort(scene.primitives.begin(), scene.primitives.end(),
                   [](const ScenePrimitive& a, const ScenePrimitive& b) { return a.node < b.node; });
  for (std::size_t p = 0; p < scene.primitives.size(); ++p) {
    ScenePrimitive& primitive = scene.primitives[p];
    check_materials(primitive, scene.materials.size());
    check_primitive(where, scene, primitive, p);
  }
  orient_faces(scene);
  mend_uvs(scene);
  mend_colours(scene);
  check_animations(where, scene);
}

}  // namespace doppel
