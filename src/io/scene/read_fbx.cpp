#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/scene/fbx_animation.h"
#include "doppel/io/scene/fbx_file.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/scene_images.h"
#include "doppel/io/scene/srgb.h"

namespace doppel {

namespace {

using Affine = Eigen::Affine3d;

constexpr std::int64_t kMaxWeights = 32;  // per vertex that is allowed

Eigen::Vector3d fbx_vector(const FbxRecord& object, const char* property, double usual = 0.0) {
  const FbxRecord* found = fbx_property(object, property);
  if (!found) return Eigen::Vector3d::Constant(usual);
  return {found->number(4, usual), found->number(5, usual), found->number(6, usual)};
}

/// A matrix as FBX writes it: row vectors in rows, which is column vectors in columns.
std::optional<Affine> fbx_matrix(const FbxRecord* record) {
  const auto values = record ? record->numbers() : std::vector<double>();
  if (values.size() != 16) return std::nullopt;
  Affine transform;
  transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(values.data());
  transform.makeAffine();
  return transform.matrix().allFinite() ? std::optional<Affine>(transform) : std::nullopt;
}

/// The transform of a model's geometry, which its children do not inherit.
Affine geometric_transform(const FbxRecord& model) {
  return Eigen::Translation3d(fbx_vector(model, "GeometricTranslation")) *
         Affine(fbx_rotation(0, fbx_vector(model, "GeometricRotation"))) *
         Eigen::Scaling(fbx_vector(model, "GeometricScaling", 1.0));
}

SceneNode fbx_node(const FbxRecord& model) {
  SceneNode node;
  node.name = fbx_name(model);
  node.translation = fbx_vector(model, "Lcl Translation");
  node.rotation = fbx_rotation(fbx_choice(model, "RotationOrder", 0, 5), fbx_vector(model, "Lcl Rotation"));
  node.scale = fbx_vector(model, "Lcl Scaling", 1.0);
  const Eigen::Vector3d pivot = fbx_vector(model, "RotationPivot"), scaling_pivot = fbx_vector(model, "ScalingPivot");
  node.before = Eigen::Translation3d(fbx_vector(model, "RotationOffset") + pivot) *
                Affine(fbx_rotation(0, fbx_vector(model, "PreRotation")));
  node.between = Affine(fbx_rotation(0, fbx_vector(model, "PostRotation")).conjugate()) *
                 Eigen::Translation3d(-pivot + fbx_vector(model, "ScalingOffset") + scaling_pivot);
  node.after = Affine(Eigen::Translation3d(-scaling_pivot));
  return node;
}

/// Turns the objects of an FBX file into a Scene.
class FbxReader {
 public:
  FbxReader(const std::filesystem::path& path, const SceneLimits& limits)
      : path_(path), limits_(limits), images_(path, limits), root_(read_fbx_records(path, limits)), objects_(root_) {}

  Scene read() {
    read_settings();
    read_models();
    read_surfaces();
    try {
      scene_.animations =
          read_fbx_animations(objects_, fbx_ticks_per_second(root_), node_of_, scene_.warnings, limits_);
    } catch (const FileError&) {
      throw;
    } catch (const Error& e) {
      fail_at({path_.string(), 0}, "{}", e.what());
    }
    if (unnormalised_ > 0)
      scene_.warnings.push_back(
          fmt::format("the skinning weights of {} vertices do not sum to 1 and are normalised", unnormalised_));
    return std::move(scene_);
  }

 private:
  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at({path_.string(), 0}, format, std::forward<Args>(args)...);
  }
  void read_settings();
  void read_models();
  void read_surfaces();
  void read_surface(const FbxRecord& model, const FbxRecord& geometry);
  void read_polygons(const FbxRecord& geometry, ScenePrimitive& primitive);
  void read_layers(const FbxRecord& geometry, const FbxRecord& model, ScenePrimitive& primitive);
  std::vector<Triangle> layer_indices(const FbxRecord& layer, const char* index_name, std::size_t count,
                                      const std::string& surface, const char* element) const;
  void read_uvs(const FbxRecord& geometry, ScenePrimitive& primitive) const;
  void read_colours(const FbxRecord& geometry, ScenePrimitive& primitive) const;
  int read_skin(const FbxRecord& model, const FbxRecord& geometry, ScenePrimitive& primitive);
  void add_cluster(const FbxRecord& cluster, const FbxRecord& model, SceneSkin& skin, std::vector<JointWeights>& rows);
  void check_bind_poses(const FbxRecord& model, const std::vector<const FbxRecord*>& clusters, SceneSkin& skin);
  int material_of(const FbxRecord& material);
  void read_texture(const FbxRecord& material, SceneMaterial& result);

  std::filesystem::path path_;
  SceneLimits limits_;
  SceneImages images_;
  FbxRecord root_;
  FbxObjects objects_;
  Scene scene_;
  std::map<const FbxRecord*, int> node_of_;
  std::map<const FbxRecord*, int> material_index_;
  long unnormalised_ = 0;
  std::int64_t vertices_ = 0, faces_ = 0, weights_ = 0;
  /// Of the geometry in work: the corners of its triangles, as indices into its list of corners, and its polygons.
  std::vector<Triangle> corners_;
  std::vector<int> polygon_of_face_, vertex_of_corner_;
};

void FbxReader::read_settings() {
  const FbxRecord* settings = root_.child("GlobalSettings");
  const FbxRecord none;
  const FbxRecord& from = settings ? *settings : none;
  const double unit = fbx_number(from, "UnitScaleFactor", 1.0);
  if (unit > 0 && std::isfinite(unit)) scene_.metres_per_unit = 0.01 * unit;
  scene_.up = "xyz"[fbx_choice(from, "UpAxis", 1, 2)];
  if (fbx_number(from, "UpAxisSign", 1) < 0)
    scene_.warnings.emplace_back("the file's up axis points down; it is not turned");
}

void FbxReader::read_models() {
  const auto models = objects_.all("Model");
  if (models.size() > as_size(limits_.nodes))
    fail_here("the file has {} nodes; at most {} are read", models.size(), limits_.nodes);
  for (const FbxRecord* model : models) {
    node_of_[model] = static_cast<int>(scene_.nodes.size());
    scene_.nodes.push_back(fbx_node(*model));
  }
  for (const FbxRecord* model : models) {
    // A model is also connected above to what it is a joint of; only another model is its parent.
    const auto parents = objects_.above(*model, "Model");
    if (!parents.empty()) scene_.nodes[node_of_[model]].parent = node_of_[parents[0]];
  }
  check_tree(path_, scene_.nodes);  // before anything follows the parents
}

void FbxReader::read_surfaces() {
  for (const auto& model : objects_.all("Model"))
    for (const FbxRecord* geometry : objects_.below(*model, "Geometry"))
      if (geometry->child("PolygonVertexIndex")) read_surface(*model, *geometry);
}

void FbxReader::read_surface(const FbxRecord& model, const FbxRecord& geometry) {
  if (scene_.primitives.size() >= as_size(limits_.nodes))
    fail_here("the file has more than {} surfaces, which is the most that is read", limits_.nodes);
  ScenePrimitive primitive;
  primitive.node = node_of_[&model];
  primitive.name = fbx_name(geometry).empty() ? fbx_name(model) : fbx_name(geometry);
  const auto numbers = geometry.child("Vertices") ? geometry.child("Vertices")->numbers() : std::vector<double>();
  vertices_ += static_cast<std::int64_t>(numbers.size() / 3);
  if (vertices_ > limits_.vertices) fail_here("the file has more than {} vertices", limits_.vertices);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    primitive.vertices.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  read_polygons(geometry, primitive);
  read_layers(geometry, model, primitive);
  primitive.skin = read_skin(model, geometry, primitive);
  const Affine geometric = geometric_transform(model);
  for (Eigen::Vector3d& vertex : primitive.vertices) vertex = geometric * vertex;
  scene_.primitives.push_back(std::move(primitive));
}

/// A polygon's last corner is written as -(vertex + 1).
void FbxReader::read_polygons(const FbxRecord& geometry, ScenePrimitive& primitive) {
  corners_.clear();
  polygon_of_face_.clear();
  vertex_of_corner_.clear();
  int first = 0, polygon = 0;
  for (const std::int64_t entry : geometry.child("PolygonVertexIndex")->integers()) {
    const std::int64_t vertex = entry < 0 ? -(entry + 1) : entry;
    if (vertex >= primitive.num_vertices())
      fail_here("a polygon of '{}' names vertex {}, but there are {}", primitive.name, vertex,
                primitive.num_vertices());
    vertex_of_corner_.push_back(static_cast<int>(vertex));
    if (entry >= 0) continue;
    const int end = static_cast<int>(vertex_of_corner_.size());
    faces_ += std::max(end - first - 2, 0);
    if (faces_ > limits_.triangles)
      fail_here("the file has more than {} triangles, which is the most that is read", limits_.triangles);
    split_polygon(end - first, [&](int a, int b, int c) {
      corners_.push_back({first + a, first + b, first + c});
      polygon_of_face_.push_back(polygon);
    });
    first = end;
    ++polygon;
  }
  for (const Triangle& corner : corners_)
    primitive.faces.push_back(
        {vertex_of_corner_[corner[0]], vertex_of_corner_[corner[1]], vertex_of_corner_[corner[2]]});
}

void FbxReader::read_layers(const FbxRecord& geometry, const FbxRecord& model, ScenePrimitive& primitive) {
  std::vector<int> materials;
  for (const FbxRecord* material : objects_.below(model, "Material")) materials.push_back(material_of(*material));
  if (!materials.empty()) primitive.material = materials[0];
  const FbxRecord* layer = geometry.child("LayerElementMaterial");
  if (layer && materials.size() > 1 && layer->child("Materials")) {
    const auto chosen = layer->child("Materials")->integers();
    const auto material = [&](std::size_t polygon) {
      const std::int64_t index = polygon < chosen.size() ? chosen[polygon] : chosen.empty() ? 0 : chosen[0];
      return index >= 0 && as_size(index) < materials.size() ? materials[index] : materials[0];
    };
    if (chosen.size() <= 1)
      primitive.material = material(0);
    else
      for (const int polygon : polygon_of_face_) primitive.face_materials.push_back(material(as_size(polygon)));
  }
  read_uvs(geometry, primitive);
  read_colours(geometry, primitive);
}

/// Which of a layer's `count` values the corners of the triangles have.
/// @param index_name the record of the indices, if the layer has any
/// @param surface, element the name of the surface, and what the values are, for errors
std::vector<Triangle> FbxReader::layer_indices(const FbxRecord& layer, const char* index_name, std::size_t count,
                                               const std::string& surface, const char* element) const {
  const auto indices = layer.child(index_name) ? layer.child(index_name)->integers() : std::vector<std::int64_t>();
  const FbxRecord* type = layer.child("MappingInformationType");
  const std::string mapping = type ? type->text(0) : "";
  const bool by_vertex = mapping == "ByVertice" || mapping == "ByVertex";
  std::vector<Triangle> faces;
  for (const Triangle& corner : corners_) {
    Triangle face{};
    for (std::size_t c = 0; c < 3; ++c) {
      const int entry = by_vertex ? vertex_of_corner_[corner[c]] : corner[c];
      const std::int64_t value = indices.empty() ? entry : as_size(entry) < indices.size() ? indices[entry] : 0;
      if (value < 0 || as_size(value) >= count)
        fail_here("a polygon of '{}' names {} {}, but there are {}", surface, element, value, count);
      face[c] = static_cast<int>(value);
    }
    faces.push_back(face);
  }
  return faces;
}

void FbxReader::read_uvs(const FbxRecord& geometry, ScenePrimitive& primitive) const {
  const FbxRecord* layer = geometry.child("LayerElementUV");
  if (!layer || !layer->child("UV")) return;
  const auto values = layer->child("UV")->numbers();
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) primitive.uvs.emplace_back(values[i], values[i + 1]);
  primitive.face_uvs = layer_indices(*layer, "UVIndex", primitive.uvs.size(), primitive.name, "texture coordinate");
}

/// Colours of vertices, as displayed: the means of their corners. Some programs write white for all; this is no colour.
void FbxReader::read_colours(const FbxRecord& geometry, ScenePrimitive& primitive) const {
  const FbxRecord* layer = geometry.child("LayerElementColor");
  if (!layer || !layer->child("Colors")) return;
  const auto values = layer->child("Colors")->numbers();
  if (std::all_of(values.begin(), values.end(), [](double value) { return value == 1.0; })) return;
  const auto indices = layer_indices(*layer, "ColorIndex", values.size() / 4, primitive.name, "colour");
  std::vector<Eigen::Vector4d> sums(primitive.vertices.size(), Eigen::Vector4d::Zero());  // and the number of corners
  for (std::size_t f = 0; f < indices.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const double* colour = values.data() + 4 * as_size(indices[f][c]);
      sums[as_size(primitive.faces[f][c])] += Eigen::Vector4d(colour[0], colour[1], colour[2], 1.0);
    }
  for (const Eigen::Vector4d& sum : sums) {
    const Eigen::Vector3d colour = sum.head<3>() / std::max(sum[3], 1.0);
    primitive.colours.push_back(colour.allFinite() ? Eigen::Vector3d(colour.cwiseMax(0.0).cwiseMin(1.0))
                                                   : Eigen::Vector3d::Zero());
  }
}

void FbxReader::add_cluster(const FbxRecord& cluster, const FbxRecord& model, SceneSkin& skin,
                            std::vector<JointWeights>& rows) {
  const auto joints = objects_.below(cluster, "Model");
  const auto link = fbx_matrix(cluster.child("TransformLink")), own = fbx_matrix(cluster.child("Transform"));
  const int joint = static_cast<int>(skin.joints.size());
  skin.joints.push_back(node_of_[joints[0]]);
  skin.joint_from_mesh.push_back(own ? *own : link ? link->inverse() : Affine::Identity());
  const auto vertices = cluster.child("Indexes") ? cluster.child("Indexes")->integers() : std::vector<std::int64_t>();
  const auto weights = cluster.child("Weights") ? cluster.child("Weights")->numbers() : std::vector<double>();
  weights_ += static_cast<std::int64_t>(weights.size());
  if (weights_ > kMaxWeights * limits_.vertices)
    fail_here("the file has more than {} skinning weights, which is the most that is read",
              kMaxWeights * limits_.vertices);
  for (std::size_t i = 0; i < std::min(vertices.size(), weights.size()); ++i) {
    if (vertices[i] < 0 || as_size(vertices[i]) >= rows.size())
      fail_here("the weights of '{}' for '{}' name vertex {}, but there are {}", fbx_name(*joints[0]), fbx_name(model),
                vertices[i], rows.size());
    if (!std::isfinite(weights[i]) || weights[i] < 0)
      fail_here("a weight of '{}' for '{}' is {}; weights are not negative", fbx_name(*joints[0]), fbx_name(model),
                weights[i]);
    rows[vertices[i]].emplace_back(joint, weights[i]);
  }
}

/// `TransformLink * Transform` is where the mesh stood when it was bound, the same for every joint. Where a file says
/// otherwise its `Transform` is not what it should be, and the mesh's own position is used instead.
void FbxReader::check_bind_poses(const FbxRecord& model, const std::vector<const FbxRecord*>& clusters,
                                 SceneSkin& skin) {
  std::vector<Affine> links;
  bool agree = true;
  Affine first = Affine::Identity();
  for (std::size_t j = 0; j < clusters.size(); ++j) {
    const auto link = fbx_matrix(clusters[j]->child("TransformLink"));
    if (!link) return;
    links.push_back(*link);
    const Affine mesh = *link * skin.joint_from_mesh[j];
    if (j == 0) first = mesh;
    const double size = std::max(first.matrix().cwiseAbs().maxCoeff(), 1.0);
    agree = agree && (mesh.matrix() - first.matrix()).cwiseAbs().maxCoeff() < 1e-3 * size;
  }
  skin.bind_transform = first;
  if (agree) return;
  const Affine world_from_mesh = node_transforms(scene_)[node_of_[&model]];
  skin.bind_transform = world_from_mesh;
  for (std::size_t j = 0; j < clusters.size(); ++j) skin.joint_from_mesh[j] = links[j].inverse() * world_from_mesh;
  scene_.warnings.push_back(fmt::format(
      "the joints of '{}' disagree on where it was bound; its position in the file is used", fbx_name(model)));
}

int FbxReader::read_skin(const FbxRecord& model, const FbxRecord& geometry, ScenePrimitive& primitive) {
  std::vector<const FbxRecord*> clusters;
  for (const FbxRecord* deformer : objects_.below(geometry, "Deformer")) {
    if (deformer->text(2) == "BlendShape")
      scene_.warnings.push_back(fmt::format("the blend shapes of '{}' are left out", primitive.name));
    if (deformer->text(2) != "Skin") continue;
    for (const FbxRecord* cluster : objects_.below(*deformer, "Deformer"))
      if (!objects_.below(*cluster, "Model").empty()) clusters.push_back(cluster);
  }
  if (clusters.empty()) return -1;
  SceneSkin skin;
  skin.name = primitive.name;
  std::vector<JointWeights> rows(primitive.vertices.size());
  for (const FbxRecord* cluster : clusters) add_cluster(*cluster, model, skin, rows);
  check_bind_poses(model, clusters, skin);
  long loose = 0;
  for (JointWeights& row : rows) {
    if (row.empty()) ++loose;
    if (!append_weights(primitive, std::move(row))) ++unnormalised_;
  }
  unnormalised_ -= loose;
  if (loose > 0)
    scene_.warnings.push_back(
        fmt::format("{} vertices of '{}' have no weights and follow its node", loose, primitive.name));
  scene_.skins.push_back(std::move(skin));
  return static_cast<int>(scene_.skins.size()) - 1;
}

void FbxReader::read_texture(const FbxRecord& material, SceneMaterial& result) {
  auto textures = objects_.below(material, "Texture", "DiffuseColor");
  for (const char* other : {"Maya|baseColor", "3dsMax|Parameters|base_color_map", "Maya|TEX_color_map", "BaseColor"})
    if (textures.empty()) textures = objects_.below(material, "Texture", other);
  if (textures.empty()) return;
  for (const FbxRecord* video : objects_.below(*textures[0], "Video")) {
    const FbxRecord* content = video->child("Content");
    result.texture = images_.of_bytes(content ? content->text(0) : "");
    if (!result.texture.empty()) return;
  }
  for (const char* name : {"RelativeFilename", "FileName"}) {
    const FbxRecord* file = textures[0]->child(name);
    result.texture_file = file ? file->text(0) : "";
    result.texture = images_.of_file(result.texture_file);
    if (!result.texture.empty()) return;
  }
  scene_.warnings.push_back(fmt::format(
      "the texture of material '{}' is neither in the file nor beside it; its colour is used", fbx_name(material)));
}

int FbxReader::material_of(const FbxRecord& material) {
  const auto [entry, added] = material_index_.try_emplace(&material, static_cast<int>(scene_.materials.size()));
  if (!added) return entry->second;
  SceneMaterial result;
  result.name = fbx_name(material);
  read_texture(material, result);
  if (result.texture.empty()) {
    const Eigen::Vector3d colour = fbx_vector(material, "DiffuseColor", 0.8);
    result.colour << srgb(colour[0]), srgb(colour[1]), srgb(colour[2]), 1.0;
    if (!result.colour.allFinite()) result.colour.setOnes();
  }
  scene_.materials.push_back(std::move(result));
  return entry->second;
}

}  // namespace

Scene read_fbx(const std::filesystem::path& path, const SceneLimits& limits) { return FbxReader(path, limits).read(); }

}  // namespace doppel
