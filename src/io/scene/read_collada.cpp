#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <map>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/scene/collada_guard.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/scene_images.h"

namespace doppel {

namespace {

Eigen::Affine3d to_affine(const aiMatrix4x4& m) {
  Eigen::Affine3d transform;
  for (unsigned row = 0; row < 4; ++row)
    for (unsigned column = 0; column < 4; ++column)
      transform.matrix()(row, column) = static_cast<double>(m[row][column]);
  transform.makeAffine();
  return transform;
}

Eigen::Vector3d to_vector(const aiVector3D& v) { return {v.x, v.y, v.z}; }

/// Translation, rotation and scale of a node; the whole matrix in `after` where it has shear.
void set_transform(const Eigen::Affine3d& transform, SceneNode& node) {
  const Eigen::Matrix3d linear = transform.linear();
  Eigen::Vector3d scale = linear.colwise().norm().transpose();
  if (linear.determinant() < 0) scale = -scale;
  node.after = transform;
  if (!(scale.cwiseAbs().minCoeff() > 0)) return;
  const Eigen::Matrix3d turn = linear * scale.cwiseInverse().asDiagonal();
  if (!(turn * turn.transpose()).isIdentity(1e-5)) return;
  node.translation = transform.translation();
  node.rotation = Eigen::Quaterniond(turn).normalized();
  node.scale = scale;
  node.after = Eigen::Affine3d::Identity();
}

/// Turns an assimp scene into a Scene. Assimp doubles the vertices of a face or along seams of the texture; vertices of
/// one node that have the same position and weights are joined again, because UVs belong to corners here.
class ColladaReader {
 public:
  ColladaReader(const std::filesystem::path& path, const SceneLimits& limits)
      : path_(path), limits_(limits), images_(path, limits) {}

  Scene read() {
    const std::string text = read_file(path_);
    refuse_what_assimp_trusts(path_, text);
    importer_.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
    importer_.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_USE_COLLADA_NAMES, true);
    importer_.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_LINE | aiPrimitiveType_POINT);
    try {
      from_ = importer_.ReadFile(path_.string(), aiProcess_Triangulate | aiProcess_SortByPType);
    } catch (const std::exception& e) {
      fail_at({path_.string(), 0}, "cannot be read: {}", e.what());
    }
    if (!from_ || !from_->mRootNode) fail_at({path_.string(), 0}, "cannot be read: {}", importer_.GetErrorString());
    read_unit_and_axis(text);
    read_node(*from_->mRootNode, -1);
    read_materials();
    for (const auto& [node, index] : nodes_) read_surfaces(*node, index);
    read_animations();
    return std::move(scene_);
  }

 private:
  void read_unit_and_axis(const std::string& text);
  void read_node(const aiNode& node, int parent);
  void read_materials();
  void read_texture(const aiMaterial& material, SceneMaterial& result);
  void read_surfaces(const aiNode& node, int index);
  void add_mesh(const aiMesh& mesh, ScenePrimitive& primitive);
  void read_animations();

  struct Corner {
    std::array<float, 3> position;
    JointWeights weights;
    bool operator<(const Corner& other) const {
      return position != other.position ? position < other.position : weights < other.weights;
    }
  };

  std::filesystem::path path_;
  SceneLimits limits_;
  SceneImages images_;
  Assimp::Importer importer_;
  const aiScene* from_ = nullptr;
  Scene scene_;
  std::vector<std::pair<const aiNode*, int>> nodes_;
  std::map<std::string, int> node_by_name_;
  std::map<Corner, int> vertex_of_;  ///< of the primitive in work
};

/// Collada says unit and up axis in its `asset`, which assimp does not hand on.
void ColladaReader::read_unit_and_axis(const std::string& text) {
  const ColladaAsset asset = collada_asset(text);
  scene_.metres_per_unit = asset.metres_per_unit;
  scene_.up = asset.up;
}

void ColladaReader::read_node(const aiNode& node, int parent) {
  if (nodes_.size() >= as_size(limits_.nodes))
    fail_at({path_.string(), 0}, "the file has more than {} nodes", limits_.nodes);
  SceneNode result;
  result.name = node.mName.C_Str();
  result.parent = parent;
  Eigen::Affine3d transform = to_affine(node.mTransformation);
  // assimp multiplies the root by the unit; a Scene has the lengths of the file.
  if (parent < 0) transform = Eigen::Scaling(1.0 / scene_.metres_per_unit.value_or(1.0)) * transform;
  set_transform(transform, result);
  const int index = static_cast<int>(scene_.nodes.size());
  node_by_name_.emplace(result.name, index);
  scene_.nodes.push_back(result);
  nodes_.emplace_back(&node, index);
  for (unsigned i = 0; i < node.mNumChildren; ++i) read_node(*node.mChildren[i], index);
}

void ColladaReader::read_texture(const aiMaterial& material, SceneMaterial& result) {
  aiString path;
  if (material.GetTexture(aiTextureType_DIFFUSE, 0, &path) != aiReturn_SUCCESS &&
      material.GetTexture(aiTextureType_BASE_COLOR, 0, &path) != aiReturn_SUCCESS)
    return;
  result.texture_file = path.C_Str();
  result.texture = images_.of_file(result.texture_file);
  if (result.texture.empty())
    scene_.warnings.push_back(
        fmt::format("the texture '{}' of material '{}' is missing or cannot be decoded; its colour is used",
                    path.C_Str(), result.name));
}

void ColladaReader::read_materials() {
  for (unsigned i = 0; i < from_->mNumMaterials; ++i) {
    const aiMaterial& material = *from_->mMaterials[i];
    SceneMaterial result;
    aiString name;
    if (material.Get(AI_MATKEY_NAME, name) == aiReturn_SUCCESS) result.name = name.C_Str();
    aiColor4D colour(1, 1, 1, 1);
    read_texture(material, result);
    // With a texture, exporters write any diffuse colour, black too.
    if (result.texture.empty() && material.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == aiReturn_SUCCESS)
      result.colour = Eigen::Vector4d(colour.r, colour.g, colour.b, 1).cwiseMax(0.0).cwiseMin(1.0);
    scene_.materials.push_back(std::move(result));
  }
}

void ColladaReader::add_mesh(const aiMesh& mesh, ScenePrimitive& primitive) {
  std::vector<JointWeights> rows(mesh.mNumVertices);
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const auto node = node_by_name_.find(bone.mName.C_Str());
    if (node == node_by_name_.end())
      fail_at({path_.string(), 0}, "the skin names the joint '{}', which is not a node of the file",
              bone.mName.C_Str());
    SceneSkin& skin = scene_.skins[primitive.skin];
    skin.joints.push_back(node->second);
    skin.joint_from_mesh.push_back(to_affine(bone.mOffsetMatrix));
    for (unsigned w = 0; w < bone.mNumWeights; ++w) {
      const aiVertexWeight& weight = bone.mWeights[w];
      if (weight.mVertexId >= mesh.mNumVertices || !(weight.mWeight >= 0) || !std::isfinite(weight.mWeight))
        fail_at({path_.string(), 0}, "the weight {} of joint '{}' for vertex {} is not possible", weight.mWeight,
                bone.mName.C_Str(), weight.mVertexId);
      rows[weight.mVertexId].emplace_back(static_cast<int>(skin.joints.size()) - 1, weight.mWeight);
    }
  }
  std::vector<int> vertex_of(mesh.mNumVertices);
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D& x = mesh.mVertices[v];
    // Adding 0 makes -0 the same as 0.
    Corner corner{{x.x + 0.0F, x.y + 0.0F, x.z + 0.0F}, rows[v]};
    const auto [entry, added] = vertex_of_.try_emplace(std::move(corner), primitive.num_vertices());
    vertex_of[v] = entry->second;
    if (!added) continue;
    primitive.vertices.push_back(to_vector(x));
    if (primitive.skin >= 0) append_weights(primitive, rows[v]);
    if (mesh.mColors[0]) {
      const aiColor4D& colour = mesh.mColors[0][v];
      primitive.colours.resize(primitive.vertices.size() - 1, Eigen::Vector3d::Constant(0.8));
      primitive.colours.emplace_back(colour.r, colour.g, colour.b);
    }
  }
  if (mesh.mTextureCoords[0] && primitive.face_uvs.size() < primitive.faces.size()) {
    primitive.uvs.resize(std::max<std::size_t>(primitive.uvs.size(), 1), Eigen::Vector2d::Zero());
    primitive.face_uvs.resize(primitive.faces.size(), Triangle{0, 0, 0});
  }
  const int first_uv = static_cast<int>(primitive.uvs.size());
  if (mesh.mTextureCoords[0])
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      primitive.uvs.emplace_back(mesh.mTextureCoords[0][v].x, mesh.mTextureCoords[0][v].y);
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) continue;
    Triangle corners{}, uvs{};
    for (unsigned c = 0; c < 3; ++c) {
      if (face.mIndices[c] >= mesh.mNumVertices)
        fail_at({path_.string(), 0}, "triangle {} names vertex {}, but there are {}", f, face.mIndices[c],
                mesh.mNumVertices);
      corners[c] = vertex_of[face.mIndices[c]];
      uvs[c] = mesh.mTextureCoords[0] ? first_uv + static_cast<int>(face.mIndices[c]) : 0;
    }
    primitive.faces.push_back(corners);
    primitive.face_materials.push_back(static_cast<int>(mesh.mMaterialIndex));
    if (!primitive.uvs.empty()) primitive.face_uvs.push_back(uvs);
  }
}

/// All meshes of a node without bones are one primitive, those with bones one each.
void ColladaReader::read_surfaces(const aiNode& node, int index) {
  std::optional<ScenePrimitive> together;
  int count = 0;
  const auto finish = [&](ScenePrimitive& primitive) {
    if (!primitive.colours.empty()) primitive.colours.resize(primitive.vertices.size(), Eigen::Vector3d::Constant(0.8));
    const std::vector<int>& materials = primitive.face_materials;
    primitive.material = materials.empty() ? -1 : materials[0];
    if (std::all_of(materials.begin(), materials.end(), [&](int m) { return m == primitive.material; }))
      primitive.face_materials.clear();
    primitive.index = count++;
    scene_.primitives.push_back(std::move(primitive));
  };
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& mesh = *from_->mMeshes[node.mMeshes[i]];
    ScenePrimitive single;
    const bool skinned = mesh.mNumBones > 0;
    if (!skinned && !together) {
      together.emplace();
      vertex_of_.clear();
    }
    ScenePrimitive& primitive = skinned ? single : *together;
    primitive.node = index;
    primitive.name = mesh.mName.C_Str();
    if (!skinned) {
      add_mesh(mesh, primitive);
      continue;
    }
    const std::map<Corner, int> others = std::exchange(vertex_of_, {});
    primitive.skin = static_cast<int>(scene_.skins.size());
    scene_.skins.push_back({primitive.name, {}, {}, {}});
    add_mesh(mesh, primitive);
    vertex_of_ = others;
    finish(primitive);
  }
  if (together) finish(*together);
}

void ColladaReader::read_animations() {
  for (unsigned a = 0; a < from_->mNumAnimations; ++a) {
    const aiAnimation& from = *from_->mAnimations[a];
    const double tick = from.mTicksPerSecond > 0 ? 1 / from.mTicksPerSecond : 1.0;
    SceneAnimation animation;
    animation.name = from.mName.C_Str();
    for (unsigned c = 0; c < from.mNumChannels; ++c) {
      const aiNodeAnim& keys = *from.mChannels[c];
      const auto node = node_by_name_.find(keys.mNodeName.C_Str());
      if (node == node_by_name_.end()) continue;
      // The keys replace the whole transform of the node.
      scene_.nodes[node->second].after = Eigen::Affine3d::Identity();
      const auto add = [&](SceneChannel::Target target, unsigned count, const auto& value_of) {
        SceneChannel channel{node->second, target, SceneChannel::Interpolation::linear, {}, {}};
        for (unsigned k = 0; k < count; ++k) {
          const auto [time, value] = value_of(k);
          if (!channel.times.empty() && time * tick <= channel.times.back()) continue;
          channel.times.push_back(time * tick);
          channel.values.push_back(value);
        }
        animation.channels.push_back(std::move(channel));
      };
      const auto vector_key = [](const aiVectorKey& key) {
        return std::pair(key.mTime, Eigen::Vector4d(key.mValue.x, key.mValue.y, key.mValue.z, 0));
      };
      add(SceneChannel::Target::translation, keys.mNumPositionKeys,
          [&](unsigned k) { return vector_key(keys.mPositionKeys[k]); });
      add(SceneChannel::Target::scale, keys.mNumScalingKeys,
          [&](unsigned k) { return vector_key(keys.mScalingKeys[k]); });
      add(SceneChannel::Target::rotation, keys.mNumRotationKeys, [&](unsigned k) {
        const aiQuaternion& q = keys.mRotationKeys[k].mValue;
        return std::pair(keys.mRotationKeys[k].mTime, Eigen::Vector4d(q.x, q.y, q.z, q.w));
      });
    }
    scene_.animations.push_back(std::move(animation));
  }
}

}  // namespace

Scene read_collada(const std::filesystem::path& path, const SceneLimits& limits) {
  return ColladaReader(path, limits).read();
}

}  // namespace doppel
