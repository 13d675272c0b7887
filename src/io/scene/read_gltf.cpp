#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/gltf_draco.h"
#include "doppel/io/scene/gltf_file.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/scene_images.h"
#include "doppel/io/scene/srgb.h"

namespace doppel {

namespace {

using Json = nlohmann::json;

/// Turns a GltfFile into a Scene, part by part.
class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, const SceneLimits& limits)
      : file_(path, limits), limits_(limits), scene_images_(path, limits) {}

  Scene read() {
    scene_.metres_per_unit = 1.0;
    scene_.up = 'y';
    read_nodes();
    read_materials();
    read_skins();
    read_primitives();
    read_animations();
    if (!file_.look_warning().empty()) scene_.warnings.push_back(file_.look_warning());
    if (morphs_)
      scene_.warnings.emplace_back("face shapes (morph targets) keep their default; their animation is left out");
    if (left_out_ > 0)
      scene_.warnings.push_back(fmt::format("{} primitives of points or lines are left out", left_out_));
    if (unnormalised_ > 0)
      scene_.warnings.push_back(
          fmt::format("the skinning weights of {} vertices do not sum to 1 and are normalised", unnormalised_));
    return std::move(scene_);
  }

 private:
  void read_nodes();
  void read_node_transform(const Json& entry, const std::string& where, SceneNode& node) const;
  void read_materials();
  cv::Mat read_texture(const Json& info, const std::string& where);
  void read_skins();
  std::vector<bool> shown_nodes() const;
  void read_primitives();
  void read_primitive(const Json& entry, const std::string& where, ScenePrimitive& primitive);
  void count_faces(std::size_t triangles);
  void check_corner(double corner, const ScenePrimitive& primitive, const std::string& where) const;
  bool read_faces(const Json& entry, const std::string& where, ScenePrimitive& primitive);
  void read_uvs(const Json& attributes, ScenePrimitive& primitive) const;
  void read_colours(const Json& attributes, ScenePrimitive& primitive) const;
  void read_weights(const Json& attributes, const std::string& where, ScenePrimitive& primitive);
  void apply_morphs(const Json& entry, const std::vector<double>& amounts, ScenePrimitive& primitive) const;
  void read_animations();
  bool read_channel(const Json& animation, const Json& entry, const std::string& where, SceneChannel& channel);
  std::size_t accessor_of(const Json& attributes, const std::string& name) const;
  std::optional<GltfNumbers> attribute(const Json& attributes, const std::string& name, std::size_t width,
                                       const char* what) const;

  GltfFile file_;
  SceneLimits limits_;
  Scene scene_;
  /// For each material: the set of UVs of its texture, and their transform.
  struct TextureUse {
    int set = 0;
    Eigen::Matrix<double, 2, 3> transform = Eigen::Matrix<double, 2, 3>::Identity();
  };
  std::vector<TextureUse> uses_;
  SceneImages scene_images_;
  std::map<int, cv::Mat> images_;
  std::optional<DracoPrimitive> draco_;  ///< of the primitive that is read
  long left_out_ = 0, unnormalised_ = 0, keys_ = 0;
  std::int64_t vertices_ = 0, faces_ = 0;
  bool morphs_ = false;
};

constexpr std::size_t kNoAccessor = static_cast<std::size_t>(-1);

std::size_t GltfReader::accessor_of(const Json& attributes, const std::string& name) const {
  if (!attributes.contains(name)) return kNoAccessor;
  return as_size(file_.index(attributes, name.c_str(), file_.list("accessors").size(), "attributes", true));
}

/// The numbers of an attribute of the primitive that is read; nothing when it has none of this name.
std::optional<GltfNumbers> GltfReader::attribute(const Json& attributes, const std::string& name, std::size_t width,
                                                 const char* what) const {
  const std::size_t accessor = accessor_of(attributes, name);
  if (accessor == kNoAccessor) return std::nullopt;
  if (!draco_ || !draco_->attributes.contains(name)) return file_.numbers(accessor, width, what);
  const GltfNumbers& numbers = draco_->attributes.at(name);
  if (width != 0 && numbers.width != width)
    file_.fail_here("{} ({}) in the Draco stream has {} values per row, expected {}", name, what, numbers.width, width);
  return numbers;
}

Eigen::Affine3d column_major(const double* values) {
  Eigen::Affine3d transform;
  transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(values);
  return transform;
}

void GltfReader::read_node_transform(const Json& entry, const std::string& where, SceneNode& node) const {
  if (const auto m = file_.vector(entry, "matrix", 16, where); !m.empty()) {
    node.after = column_major(m.data());
    return;
  }
  if (const auto t = file_.vector(entry, "translation", 3, where); !t.empty()) node.translation << t[0], t[1], t[2];
  if (const auto s = file_.vector(entry, "scale", 3, where); !s.empty()) node.scale << s[0], s[1], s[2];
  const auto r = file_.vector(entry, "rotation", 4, where);
  if (r.empty()) return;
  node.rotation = Eigen::Quaterniond(r[3], r[0], r[1], r[2]);
  const double length = node.rotation.norm();
  node.rotation = length > 1e-9 ? node.rotation.normalized() : Eigen::Quaterniond::Identity();
}

void GltfReader::read_nodes() {
  const Json& nodes = file_.list("nodes");
  if (nodes.size() > as_size(limits_.nodes))
    file_.fail_here("the file has {} nodes; at most {} are read", nodes.size(), limits_.nodes);
  scene_.nodes.resize(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const std::string where = fmt::format("nodes[{}]", i);
    if (!nodes[i].is_object()) file_.fail_here("{} is not an object", where);
    scene_.nodes[i].name = file_.text(nodes[i], "name");
    read_node_transform(nodes[i], where, scene_.nodes[i]);
    for (const Json& child : file_.array(nodes[i], "children", where)) {
      if (!child.is_number_unsigned() || child.get<std::uint64_t>() >= nodes.size())
        file_.fail_here("{} has the child {}, but the file has {} nodes", where, child.dump(), nodes.size());
      int& parent = scene_.nodes[child.get<std::size_t>()].parent;
      if (parent >= 0 && parent != static_cast<int>(i))
        file_.fail_here("node {} is a child of two nodes, {} and {}", child.get<std::size_t>(), parent, i);
      parent = static_cast<int>(i);
    }
  }
}

cv::Mat GltfReader::read_texture(const Json& info, const std::string& where) {
  const Json& textures = file_.list("textures");
  const int texture = file_.index(info, "index", textures.size(), where, true);
  const Json& entry = textures[texture];
  const std::string element = fmt::format("textures[{}]", texture);
  const std::size_t images = file_.list("images").size();
  int image = file_.index(entry, "source", images, element);
  const Json& webp = file_.object(file_.object(entry, "extensions"), "EXT_texture_webp");
  if (image < 0 && !webp.empty()) image = file_.index(webp, "source", images, element);
  if (image < 0) {
    const bool basis = file_.object(entry, "extensions").contains("KHR_texture_basisu");
    scene_.warnings.push_back(fmt::format(
        "{} is {}; its base colour is used", element,
        basis
            ? "a KTX2 image of Basis Universal (KHR_texture_basisu), which is not read. Write the file with images in "
              "PNG, JPEG or WebP (gltfpack: leave out -tc and -tu)"
            : "in a format that is not read"));
    return {};
  }
  if (const auto known = images_.find(image); known != images_.end()) return known->second;
  const std::string bytes = file_.image_bytes(as_size(image));
  const cv::Mat pixels = scene_images_.of_bytes(bytes);
  if (pixels.empty())
    scene_.warnings.push_back(fmt::format("image {} ('{}') {}; its base colour is used", image,
                                          file_.text(file_.list("images")[image], "uri").substr(0, 80),
                                          bytes.empty() ? "is missing" : "cannot be decoded"));
  return images_[image] = pixels;
}

void GltfReader::read_materials() {
  const Json& materials = file_.list("materials");
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const std::string where = fmt::format("materials[{}]", i);
    const Json& entry = materials[i];
    const Json& pbr = file_.object(entry, "pbrMetallicRoughness");
    const Json& old = file_.object(file_.object(entry, "extensions"), "KHR_materials_pbrSpecularGlossiness");
    SceneMaterial material{file_.text(entry, "name"), Eigen::Vector4d::Ones(), {}};
    auto colour = file_.vector(pbr, "baseColorFactor", 4, where);
    if (colour.empty()) colour = file_.vector(old, "diffuseFactor", 4, where);
    if (!colour.empty()) material.colour << srgb(colour[0]), srgb(colour[1]), srgb(colour[2]), colour[3];
    const Json& base = file_.object(pbr, "baseColorTexture");
    const Json& info = base.empty() ? file_.object(old, "diffuseTexture") : base;
    TextureUse use;
    if (!info.empty()) {
      material.texture = read_texture(info, where);
      const Json& moved = file_.object(file_.object(info, "extensions"), "KHR_texture_transform");
      const double set = file_.number(moved, "texCoord", file_.number(info, "texCoord", 0, where), where);
      use.set = static_cast<int>(std::clamp(set, 0.0, 99.0));
      const auto offset = file_.vector(moved, "offset", 2, where), scale = file_.vector(moved, "scale", 2, where);
      const double turn = file_.number(moved, "rotation", 0, where);
      const Eigen::Vector2d s = scale.empty() ? Eigen::Vector2d(1, 1) : Eigen::Vector2d(scale[0], scale[1]);
      use.transform << std::cos(turn) * s[0], std::sin(turn) * s[1], offset.empty() ? 0 : offset[0],
          -std::sin(turn) * s[0], std::cos(turn) * s[1], offset.empty() ? 0 : offset[1];
    }
    scene_.materials.push_back(material);
    uses_.push_back(use);
  }
}

void GltfReader::read_skins() {
  const Json& skins = file_.list("skins");
  for (std::size_t i = 0; i < skins.size(); ++i) {
    const std::string where = fmt::format("skins[{}]", i);
    SceneSkin skin;
    skin.name = file_.text(skins[i], "name");
    for (const Json& joint : file_.array(skins[i], "joints", where)) {
      if (!joint.is_number_unsigned() || joint.get<std::uint64_t>() >= scene_.nodes.size())
        file_.fail_here("{} names the joint {}, but the file has {} nodes", where, joint.dump(), scene_.nodes.size());
      skin.joints.push_back(joint.get<int>());
    }
    if (skin.joints.empty()) file_.fail_here("{} has no joints", where);
    skin.joint_from_mesh.assign(skin.joints.size(), Eigen::Affine3d::Identity());
    const std::size_t matrices = accessor_of(skins[i], "inverseBindMatrices");
    if (matrices != kNoAccessor) {
      const GltfNumbers numbers = file_.numbers(matrices, 16, "inverse bind matrices");
      if (numbers.count < skin.joints.size())
        file_.fail_here("{} has {} joints but {} inverse bind matrices", where, skin.joints.size(), numbers.count);
      for (std::size_t j = 0; j < skin.joints.size(); ++j) skin.joint_from_mesh[j] = column_major(numbers.row(j));
    }
    scene_.skins.push_back(std::move(skin));
  }
}

/// The corners of triangle `t` in the three modes of triangles.
Triangle corners_of(int mode, int t) {
  if (mode == 5) return t % 2 == 0 ? Triangle{t, t + 1, t + 2} : Triangle{t + 1, t, t + 2};
  if (mode == 6) return {0, t + 1, t + 2};
  return {3 * t, 3 * t + 1, 3 * t + 2};
}

/// Counts triangles. @throws FileError when they are too many
void GltfReader::count_faces(std::size_t triangles) {
  faces_ += static_cast<std::int64_t>(triangles);
  if (faces_ > limits_.triangles)
    file_.fail_here("the file has more than {} triangles, which is the most that is read", limits_.triangles);
}

void GltfReader::check_corner(double corner, const ScenePrimitive& primitive, const std::string& where) const {
  if (!(corner >= 0) || corner >= primitive.num_vertices())
    file_.fail_here("a triangle of {} names vertex {}, but there are {}", where, corner, primitive.num_vertices());
}

bool GltfReader::read_faces(const Json& entry, const std::string& where, ScenePrimitive& primitive) {
  const int mode = file_.whole(entry, "mode", 4, where);
  if (mode < 4 || mode > 6) return false;
  if (draco_) {
    count_faces(draco_->faces.size());
    for (const Triangle& face : draco_->faces)
      for (const int corner : face) check_corner(corner, primitive, where);
    primitive.faces = draco_->faces;
    return true;
  }
  std::vector<double> corners;
  const std::size_t indices = accessor_of(entry, "indices");
  if (indices != kNoAccessor) {
    corners = file_.numbers(indices, 1, "indices of triangles").values;
  } else {
    for (int v = 0; v < primitive.num_vertices(); ++v) corners.push_back(v);
  }
  for (const double corner : corners) check_corner(corner, primitive, where);
  const int count = static_cast<int>(corners.size());
  const int triangles = mode == 4 ? count / 3 : std::max(0, count - 2);
  count_faces(as_size(triangles));
  primitive.faces.reserve(triangles);
  for (int t = 0; t < triangles; ++t) {
    Triangle face = corners_of(mode, t);
    for (int& corner : face) corner = static_cast<int>(corners[corner]);
    primitive.faces.push_back(face);
  }
  return true;
}

void GltfReader::read_uvs(const Json& attributes, ScenePrimitive& primitive) const {
  const TextureUse use = primitive.material >= 0 ? uses_[primitive.material] : TextureUse();
  const auto uvs = attribute(attributes, fmt::format("TEXCOORD_{}", use.set), 2, "texture coordinates");
  if (!uvs || uvs->count != primitive.vertices.size()) return;
  for (std::size_t v = 0; v < uvs->count; ++v) {
    const Eigen::Vector2d uv = use.transform * Eigen::Vector3d(uvs->row(v)[0], uvs->row(v)[1], 1.0);
    primitive.uvs.emplace_back(uv.x(), 1.0 - uv.y());
  }
  primitive.face_uvs = primitive.faces;
}

/// Colours of vertices, times the colour of a material without texture (glTF 2.0, 3.9.2).
void GltfReader::read_colours(const Json& attributes, ScenePrimitive& primitive) const {
  const auto colours = attribute(attributes, "COLOR_0", 0, "colours");
  if (!colours || colours->width < 3 || colours->count != primitive.vertices.size()) return;
  const SceneMaterial* material = primitive.material >= 0 ? &scene_.materials[primitive.material] : nullptr;
  Eigen::Vector3d factor = Eigen::Vector3d::Ones();
  if (material && material->texture.empty())
    factor = material->colour.head<3>().unaryExpr([](double x) { return linear_of_srgb(x); });
  for (std::size_t v = 0; v < colours->count; ++v) {
    const Eigen::Vector3d linear = factor.cwiseProduct(Eigen::Vector3d(colours->row(v)));
    primitive.colours.emplace_back(linear.unaryExpr([](double x) { return srgb(x); }));
  }
}

void GltfReader::read_weights(const Json& attributes, const std::string& where, ScenePrimitive& primitive) {
  if (primitive.skin < 0) return;
  std::vector<GltfNumbers> joints, weights;
  for (int set = 0;; ++set) {
    auto j = attribute(attributes, fmt::format("JOINTS_{}", set), 4, "joints of vertices");
    auto w = attribute(attributes, fmt::format("WEIGHTS_{}", set), 4, "skinning weights");
    if (!j || !w) break;
    joints.push_back(std::move(*j));
    weights.push_back(std::move(*w));
    if (joints.back().count != primitive.vertices.size() || weights.back().count != primitive.vertices.size())
      file_.fail_here("{} has {} vertices but {} rows of joints and {} of weights", where, primitive.vertices.size(),
                      joints.back().count, weights.back().count);
  }
  const double count = static_cast<double>(scene_.skins[primitive.skin].joints.size());
  for (std::size_t v = 0; v < primitive.vertices.size(); ++v) {
    JointWeights row;
    for (std::size_t set = 0; set < joints.size(); ++set)
      for (std::size_t c = 0; c < 4; ++c) {
        const double weight = weights[set].row(v)[c], joint = joints[set].row(v)[c];
        if (weight == 0.0) continue;
        if (!(weight > 0.0) || !std::isfinite(weight))
          file_.fail_here("{}: a skinning weight of vertex {} is {}; weights are not negative", where, v, weight);
        if (!(joint >= 0) || joint >= count)
          file_.fail_here("{}: vertex {} names joint {} of its skin, which has {}", where, v, joint, count);
        row.emplace_back(static_cast<int>(joint), weight);
      }
    if (!append_weights(primitive, std::move(row))) ++unnormalised_;
  }
}

/// Moves the vertices by the targets whose amount is not 0 in the file.
void GltfReader::apply_morphs(const Json& entry, const std::vector<double>& amounts, ScenePrimitive& primitive) const {
  const Json& targets = file_.array(entry, "targets", "a primitive");
  for (std::size_t t = 0; t < targets.size() && t < amounts.size(); ++t) {
    const std::size_t accessor = amounts[t] == 0.0 ? kNoAccessor : accessor_of(targets[t], "POSITION");
    if (accessor == kNoAccessor) continue;
    const GltfNumbers moves = file_.numbers(accessor, 3, "positions of a morph target");
    for (std::size_t v = 0; v < std::min(moves.count, primitive.vertices.size()); ++v)
      primitive.vertices[v] += amounts[t] * Eigen::Map<const Eigen::Vector3d>(moves.row(v));
  }
}

void GltfReader::read_primitive(const Json& entry, const std::string& where, ScenePrimitive& primitive) {
  const Json& attributes = file_.object(entry, "attributes");
  const std::size_t positions = accessor_of(attributes, "POSITION");
  if (positions == kNoAccessor) return;
  // A file that does not require the extension has the numbers also without compression.
  draco_.reset();
  if (!file_.object(file_.object(entry, "extensions"), "KHR_draco_mesh_compression").empty() &&
      file_.index(file_.list("accessors")[positions], "bufferView", file_.list("bufferViews").size(), where) < 0)
    draco_ = read_draco(file_, entry, limits_, where);
  const GltfNumbers points = attribute(attributes, "POSITION", 3, "positions").value();
  vertices_ += static_cast<std::int64_t>(points.count);
  if (vertices_ > limits_.vertices)
    file_.fail_here("the file has more than {} vertices, which is the most that is read", limits_.vertices);
  for (std::size_t v = 0; v < points.count; ++v) primitive.vertices.emplace_back(points.row(v));
  primitive.material = file_.index(entry, "material", scene_.materials.size(), where);
  if (!read_faces(entry, where, primitive)) return;
  read_uvs(attributes, primitive);
  read_colours(attributes, primitive);
  read_weights(attributes, where, primitive);
}

/// Whether each node belongs to the scene that the file shows, or the first one; without scenes, all do.
std::vector<bool> GltfReader::shown_nodes() const {
  const Json& scenes = file_.list("scenes");
  std::vector<bool> shown(scene_.nodes.size(), scenes.empty());
  if (scenes.empty()) return shown;
  const int chosen = std::max(file_.index(file_.root(), "scene", scenes.size(), "the file"), 0);
  const std::string where = fmt::format("scenes[{}]", chosen);
  for (const Json& node : file_.array(scenes[as_size(chosen)], "nodes", where)) {
    if (!node.is_number_unsigned() || node.get<std::uint64_t>() >= shown.size())
      file_.fail_here("{} names the node {}, but the file has {} nodes", where, node.dump(), shown.size());
    shown[node.get<std::size_t>()] = true;
  }
  std::vector<std::vector<std::size_t>> children(shown.size());
  std::vector<std::size_t> found;
  for (std::size_t n = 0; n < shown.size(); ++n) {
    if (scene_.nodes[n].parent >= 0) children[as_size(scene_.nodes[n].parent)].push_back(n);
    if (shown[n]) found.push_back(n);
  }
  while (!found.empty()) {
    const std::size_t node = found.back();
    found.pop_back();
    for (const std::size_t child : children[node]) {
      if (!shown[child]) found.push_back(child);
      shown[child] = true;
    }
  }
  return shown;
}

void GltfReader::read_primitives() {
  const Json &nodes = file_.list("nodes"), &meshes = file_.list("meshes");
  const std::vector<bool> shown = shown_nodes();
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const std::string element = fmt::format("nodes[{}]", n);
    const int mesh = file_.index(nodes[n], "mesh", meshes.size(), element);
    if (mesh < 0) continue;
    if (!shown[n]) {
      scene_.warnings.push_back(
          fmt::format("the mesh of {} is not in the scene that the file shows, and is left out", element));
      continue;
    }
    const Json& entry = meshes[mesh];
    const std::string where = fmt::format("meshes[{}]", mesh);
    const Json& primitives = file_.array(entry, "primitives", where);
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      if (scene_.primitives.size() >= as_size(limits_.nodes))
        file_.fail_here("the file has more than {} surfaces, which is the most that is read", limits_.nodes);
      ScenePrimitive primitive;
      primitive.node = static_cast<int>(n);
      primitive.index = static_cast<int>(p);
      primitive.name = file_.text(entry, "name");
      primitive.skin = file_.index(nodes[n], "skin", scene_.skins.size(), element);
      const std::string part = fmt::format("{}.primitives[{}]", where, p);
      read_primitive(primitives[p], part, primitive);
      const std::size_t targets = file_.array(primitives[p], "targets", part).size();
      if (targets > 0) {
        auto amounts = file_.vector(nodes[n], "weights", targets, element);
        if (amounts.empty()) amounts = file_.vector(entry, "weights", targets, where);
        apply_morphs(primitives[p], amounts, primitive);
      }
      if (primitive.faces.empty()) ++left_out_;
      scene_.primitives.push_back(std::move(primitive));
    }
  }
}

SceneChannel::Interpolation interpolation_of(const std::string& word) {
  if (word == "STEP") return SceneChannel::Interpolation::step;
  return word == "CUBICSPLINE" ? SceneChannel::Interpolation::cubic : SceneChannel::Interpolation::linear;
}

/// @return false for a channel that moves no node (the weights of morph targets, and those of extensions)
bool GltfReader::read_channel(const Json& animation, const Json& entry, const std::string& where,
                              SceneChannel& channel) {
  const Json& target = file_.object(entry, "target");
  const std::string path = file_.text(target, "path");
  channel.node = file_.index(target, "node", scene_.nodes.size(), where);
  if (path == "weights") morphs_ = true;
  if (channel.node < 0 || (path != "translation" && path != "rotation" && path != "scale")) return false;
  channel.target = path == "translation" ? SceneChannel::Target::translation
                   : path == "rotation"  ? SceneChannel::Target::rotation
                                         : SceneChannel::Target::scale;
  const Json& samplers = file_.array(animation, "samplers", where);
  const Json& sampler =
      samplers.empty() ? samplers : samplers[file_.index(entry, "sampler", samplers.size(), where, true)];
  if (!sampler.is_object()) file_.fail_here("{} has no sampler", where);
  channel.interpolation = interpolation_of(file_.text(sampler, "interpolation"));
  const std::size_t accessors = file_.list("accessors").size();
  const auto input = as_size(file_.index(sampler, "input", accessors, where, true));
  const auto output = as_size(file_.index(sampler, "output", accessors, where, true));
  channel.times = file_.numbers(input, 1, "times of keys").values;
  const std::size_t width = channel.target == SceneChannel::Target::rotation ? 4 : 3;
  const GltfNumbers values = file_.numbers(output, width, "values of keys");
  const std::size_t each = channel.interpolation == SceneChannel::Interpolation::cubic ? 3 : 1;
  if (values.count < each * channel.times.size())
    file_.fail_here("{} has {} times but {} values", where, channel.times.size(), values.count);
  for (std::size_t i = 0; i < each * channel.times.size(); ++i) {
    const double* row = values.row(i);
    channel.values.emplace_back(row[0], row[1], row[2], width == 4 ? row[3] : 0.0);
  }
  keys_ += static_cast<long>(channel.times.size());
  if (keys_ > limits_.keys) file_.fail_here("the animations have more than {} keys", limits_.keys);
  return true;
}

void GltfReader::read_animations() {
  const Json& animations = file_.list("animations");
  for (std::size_t i = 0; i < animations.size(); ++i) {
    const std::string where = fmt::format("animations[{}]", i);
    SceneAnimation animation;
    animation.name = file_.text(animations[i], "name");
    const Json& channels = file_.array(animations[i], "channels", where);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      SceneChannel channel;
      if (read_channel(animations[i], channels[c], fmt::format("{}.channels[{}]", where, c), channel))
        animation.channels.push_back(std::move(channel));
    }
    scene_.animations.push_back(std::move(animation));
  }
}

}  // namespace

Scene read_gltf(const std::filesystem::path& path, const SceneLimits& limits) {
  return GltfReader(path, limits).read();
}

}  // namespace doppel
