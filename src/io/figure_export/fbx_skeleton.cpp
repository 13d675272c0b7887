#include "doppel/io/figure_export/fbx_skeleton.h"

#include "doppel/core/as_size.h"
#include "doppel/io/figure_export/euler_tracks.h"

namespace doppel {
namespace {

FbxNode vector_property(const char* name, const char* type, const char* label, const char* flags,
                        const Eigen::Vector3d& value) {
  return property70(name, type, label, flags, {value.x(), value.y(), value.z()});
}

/// FBX multiplies rows with matrices and writes them by rows, which is ours by columns. Lengths in units of the file.
std::vector<double> matrix_of(Eigen::Affine3d transform) {
  transform.translation() *= kFbxUnitsPerMetre;
  const Eigen::Matrix4d matrix = transform.matrix();
  return {matrix.data(), matrix.data() + 16};
}

struct BoneWeights {
  std::vector<std::int32_t> vertices;
  std::vector<double> weights;
};

/// [B] the weights of the vertices by bone.
std::vector<BoneWeights> clusters_of(const Figure& figure) {
  std::vector<BoneWeights> clusters(figure.nodes.size());
  for (std::size_t v = 0; v < figure.node.size(); ++v)
    for (std::size_t i = 0; i < 4; ++i) {
      if (figure.weight[v][i] <= 0.0F) continue;
      BoneWeights& cluster = clusters[as_size(figure.node[v][i])];
      cluster.vertices.push_back(static_cast<std::int32_t>(v));
      cluster.weights.push_back(static_cast<double>(figure.weight[v][i]));
    }
  return clusters;
}

}  // namespace

std::vector<std::int64_t> add_fbx_bones(FbxDocument& document, const Figure& figure) {
  const auto rest = rest_to_parent(figure);
  std::vector<std::int64_t> bones;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const std::string& name = figure.nodes[i].name;
    const Eigen::Vector3d offset = kFbxUnitsPerMetre * rest[i].translation();
    const Eigen::Vector3d turn = euler_angles(Eigen::Quaterniond(rest[i].linear()));
    bones.push_back(
        document.add("Model", name, "Model", "LimbNode",
                     {{"Version", {232}, {}},
                      properties70({property70("RotationActive", "bool", "", "", {1}),
                                    property70("InheritType", "enum", "", "", {1}),
                                    vector_property("PreRotation", "Vector3D", "Vector", "", turn),
                                    vector_property("Lcl Translation", "Lcl Translation", "", "A", offset),
                                    vector_property("Lcl Rotation", "Lcl Rotation", "", "A", Eigen::Vector3d::Zero()),
                                    vector_property("Lcl Scaling", "Lcl Scaling", "", "A", Eigen::Vector3d::Ones())}),
                      {"Culling", {"CullingOff"}, {}}}));
    const std::int64_t attribute =
        document.add("NodeAttribute", name, "NodeAttribute", "LimbNode",
                     {properties70({property70("Size", "double", "Number", "", {0.05 * kFbxUnitsPerMetre})}),
                      {"TypeFlags", {"Skeleton"}, {}}});
    document.connect(attribute, bones.back());
    document.connect(bones.back(), figure.nodes[i].parent < 0 ? 0 : bones[as_size(figure.nodes[i].parent)]);
  }
  return bones;
}

void add_fbx_skin(FbxDocument& document, const Figure& figure, const std::string& name,
                  const std::vector<std::int64_t>& bones, std::int64_t geometry) {
  const std::int64_t skin =
      document.add("Deformer", name, "Deformer", "Skin", {{"Version", {101}, {}}, {"Link_DeformAcuracy", {50.0}, {}}});
  document.connect(skin, geometry);
  const std::vector<BoneWeights> clusters = clusters_of(figure);
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    if (clusters[i].vertices.empty()) continue;
    const std::int64_t cluster = document.add("Deformer", figure.nodes[i].name, "SubDeformer", "Cluster",
                                              {{"Version", {100}, {}},
                                               {"UserData", {"", ""}, {}},
                                               {"Indexes", {clusters[i].vertices}, {}},
                                               {"Weights", {clusters[i].weights}, {}},
                                               {"Transform", {matrix_of(figure.rest[i].inverse())}, {}},
                                               {"TransformLink", {matrix_of(figure.rest[i])}, {}}});
    document.connect(cluster, skin);
    document.connect(bones[i], cluster);
  }
}

void add_fbx_bind_pose(FbxDocument& document, const Figure& figure, const std::string& name,
                       const std::vector<std::int64_t>& bones, std::int64_t surface) {
  std::vector<FbxNode> records{{"Type", {"BindPose"}, {}},
                               {"Version", {100}, {}},
                               {"NbPoseNodes", {static_cast<std::int32_t>(bones.size()) + 1}, {}}};
  const auto add = [&](std::int64_t model, const Eigen::Affine3d& transform) {
    records.push_back({"PoseNode", {}, {{"Node", {model}, {}}, {"Matrix", {matrix_of(transform)}, {}}}});
  };
  add(surface, Eigen::Affine3d::Identity());
  for (std::size_t i = 0; i < bones.size(); ++i) add(bones[i], figure.rest[i]);
  document.add("Pose", name, "Pose", "BindPose", std::move(records));
}

}  // namespace doppel
