#include "doppel/io/figure_export/glb_skeleton.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace doppel {
namespace {

/// A bone relative to its parent. @param standing node to world [B]
tinygltf::Node bone_node(const Figure& figure, const std::vector<Eigen::Affine3d>& standing, std::size_t bone) {
  const int parent = figure.nodes[bone].parent;
  const Eigen::Affine3d local = parent < 0 ? standing[bone] : standing[parent].inverse() * standing[bone];
  const Eigen::Quaterniond turn = Eigen::Quaterniond(local.linear()).normalized();
  const Eigen::Vector3d& offset = local.translation();
  tinygltf::Node node;
  node.name = figure.nodes[bone].name;
  node.rotation = {turn.x(), turn.y(), turn.z(), turn.w()};
  node.translation = {offset.x(), offset.y(), offset.z()};
  return node;
}

class AnimationWriter {
 public:
  AnimationWriter(GlbBuffer& buffer, const FigureTracks& tracks, const ClipPart& part)
      : buffer_(buffer), tracks_(tracks), part_(part) {}

  tinygltf::Animation written() {
    for (std::size_t i = 0; i < tracks_.rotation.size(); ++i) add_bone(i);
    if (tracks_.weights.cols() > 0) add_weights();
    animation_.name = part_.name;
    return animation_;
  }

 private:
  /// Those of the keys that are in the part.
  std::vector<int> in_part(const std::vector<int>& keys) const {
    std::vector<int> inside;
    std::copy_if(keys.begin(), keys.end(), std::back_inserter(inside),
                 [this](int key) { return key >= part_.first && key < part_.first + part_.frames; });
    return inside;
  }

  void add_bone(std::size_t bone) {
    std::vector<float> turns, offsets;
    const std::vector<int> rotation_keys = in_part(tracks_.rotation_keys[bone]),
                           translation_keys = in_part(tracks_.translation_keys[bone]);
    for (const int key : rotation_keys) {
      const Eigen::Quaterniond& turn = tracks_.rotation[bone][key];
      for (const double value : {turn.x(), turn.y(), turn.z(), turn.w()}) turns.push_back(static_cast<float>(value));
    }
    for (const int key : translation_keys)
      for (int axis = 0; axis < 3; ++axis) offsets.push_back(static_cast<float>(tracks_.translation[bone][key][axis]));
    add_channel(static_cast<int>(bone) + 1, "rotation", rotation_keys, turns, 4);
    add_channel(static_cast<int>(bone) + 1, "translation", translation_keys, offsets, 3);
  }

  void add_weights() {
    std::vector<float> weights;
    const std::vector<int> keys = in_part(tracks_.weight_keys);
    for (const int key : keys)
      for (Eigen::Index k = 0; k < tracks_.weights.cols(); ++k)
        weights.push_back(static_cast<float>(tracks_.weights(key, k)));
    add_channel(static_cast<int>(tracks_.rotation.size()) + 1, "weights", keys, weights, 1);
  }

  /// The accessor of the times of keys; equal lists share one.
  int times_of(const std::vector<int>& keys) {
    if (const auto found = times_.find(keys); found != times_.end()) return found->second;
    std::vector<float> seconds;
    seconds.reserve(keys.size());
    for (const int key : keys) seconds.push_back(static_cast<float>((key - part_.first) / part_.frames_per_second));
    return times_[keys] = buffer_.floats(seconds, 1, true);
  }

  void add_channel(int node, const char* path, const std::vector<int>& keys, const std::vector<float>& values,
                   int width) {
    tinygltf::AnimationSampler sampler;
    sampler.input = times_of(keys);
    sampler.output = buffer_.floats(values, width, false);
    sampler.interpolation = "LINEAR";
    tinygltf::AnimationChannel channel;
    channel.sampler = static_cast<int>(animation_.samplers.size());
    channel.target_node = node;
    channel.target_path = path;
    animation_.samplers.push_back(sampler);
    animation_.channels.push_back(channel);
  }

  GlbBuffer& buffer_;
  const FigureTracks& tracks_;
  const ClipPart& part_;
  tinygltf::Animation animation_;
  std::map<std::vector<int>, int> times_;
};

}  // namespace

void add_glb_skeleton(tinygltf::Model& model, GlbBuffer& buffer, const Figure& figure, const std::string& name,
                      const std::vector<Eigen::Affine3d>& standing) {
  tinygltf::Node armature;
  armature.name = name + "_armature";
  model.nodes.push_back(armature);
  tinygltf::Skin skin;
  skin.name = name;
  skin.skeleton = 0;
  std::vector<float> inverse;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const int number = static_cast<int>(i) + 1;
    model.nodes.push_back(bone_node(figure, standing, i));
    model.nodes[figure.nodes[i].parent + 1].children.push_back(number);
    skin.joints.push_back(number);
    const Eigen::Matrix4f matrix = figure.rest[i].inverse().matrix().cast<float>();
    inverse.insert(inverse.end(), matrix.data(), matrix.data() + 16);  // both are column-major
  }
  skin.inverseBindMatrices = buffer.floats(inverse, 16, false);
  tinygltf::Node mesh;
  mesh.name = name;
  mesh.mesh = 0;
  mesh.skin = static_cast<int>(model.skins.size());
  model.skins.push_back(skin);
  model.nodes.push_back(mesh);
  tinygltf::Scene scene;
  scene.nodes = {0, static_cast<int>(model.nodes.size()) - 1};
  model.defaultScene = static_cast<int>(model.scenes.size());
  model.scenes.push_back(scene);
}

void add_glb_weights(GlbBuffer& buffer, const Figure& figure, std::span<const int> vertices,
                     tinygltf::Primitive& primitive) {
  std::vector<std::uint16_t> joints;
  std::vector<float> weights;
  for (const int v : vertices) {
    for (const int node : figure.node[v]) joints.push_back(static_cast<std::uint16_t>(node));
    weights.insert(weights.end(), figure.weight[v].begin(), figure.weight[v].end());
  }
  primitive.attributes["JOINTS_0"] = buffer.joints(joints);
  primitive.attributes["WEIGHTS_0"] = buffer.floats(weights, 4, false, TINYGLTF_TARGET_ARRAY_BUFFER);
}

void add_glb_animation(tinygltf::Model& model, GlbBuffer& buffer, const FigureTracks& tracks, const ClipPart& part) {
  model.animations.push_back(AnimationWriter(buffer, tracks, part).written());
}

}  // namespace doppel
