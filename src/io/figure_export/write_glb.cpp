#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/glb_buffer.h"
#include "doppel/io/figure_export/vrm.h"
#include "doppel/io/figure_export/write_figure.h"

namespace doppel {
namespace {

constexpr int kVertexTarget = TINYGLTF_TARGET_ARRAY_BUFFER;

/// The vertices of the file: one for each pair of a vertex of the mesh and a UV.
struct SplitVertices {
  std::vector<int> vertex, uv;  ///< uv is -1 without UVs
  std::vector<std::uint32_t> corners;
};

SplitVertices split_vertices(const TriangleMesh& mesh) {
  SplitVertices split;
  std::map<std::pair<int, int>, std::uint32_t> known;
  const bool textured = !mesh.uvs.empty() && !mesh.face_uvs.empty();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::pair<int, int> corner{mesh.faces[f][c], textured ? mesh.face_uvs[f][c] : -1};
      const auto [found, added] = known.emplace(corner, static_cast<std::uint32_t>(split.vertex.size()));
      if (added) {
        split.vertex.push_back(corner.first);
        split.uv.push_back(corner.second);
      }
      split.corners.push_back(found->second);
    }
  return split;
}

/// The rows of a vector per mesh vertex, in the order of the file.
template <typename Row>
std::vector<float> spread(const SplitVertices& split, int width, const Row& row) {
  std::vector<float> values;
  for (const int v : split.vertex)
    for (int i = 0; i < width; ++i) values.push_back(static_cast<float>(row(as_size(v), i)));
  return values;
}

/// Unit normals of the mesh with the vertices moved; upwards for vertices without area.
std::vector<Eigen::Vector3d> normals_of(const TriangleMesh& mesh, const Eigen::MatrixX3f* moved) {
  TriangleMesh copy;
  copy.vertices = mesh.vertices;
  copy.faces = mesh.faces;
  for (std::size_t v = 0; moved && v < copy.vertices.size(); ++v)
    copy.vertices[v] += moved->row(static_cast<Eigen::Index>(v)).cast<double>().transpose();
  std::vector<Eigen::Vector3d> normals = vertex_normals(copy);
  for (Eigen::Vector3d& normal : normals)
    if (normal.squaredNorm() < 0.5) normal = Eigen::Vector3d::UnitY();
  return normals;
}

class GlbWriter {
 public:
  GlbWriter(const FigureFile& file, const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks)
      : file_(file), figure_(figure), morphs_(morphs), tracks_(tracks), buffer_(model_) {
    model_.asset.version = "2.0";
    model_.asset.generator = "Doppel";
    add_nodes();
    add_mesh();
    add_skin();
    if (file.clip.num_frames() > 0) add_animation();
    if (!file.rights.authors.empty()) {
      model_.extensions["VRMC_vrm"] = vrm_extension(figure, file.name, file.rights, /*first_node=*/1);
      model_.extensionsUsed.emplace_back("VRMC_vrm");
    }
  }

  std::string bytes() {
    tinygltf::TinyGLTF writer;
    std::ostringstream stream;
    if (!writer.WriteGltfSceneToStream(&model_, stream, /*prettyPrint=*/false, /*writeBinary=*/true))
      fail("tinygltf refuses to write the figure '{}'", file_.name);
    return stream.str();
  }

 private:
  /// Node 0 holds the skeleton, nodes 1 ... B are its bones, node B + 1 is the mesh.
  void add_nodes() {
    tinygltf::Node armature;
    armature.name = file_.name + "_armature";
    model_.nodes.push_back(armature);
    for (std::size_t i = 0; i < figure_.nodes.size(); ++i) {
      const int parent = figure_.nodes[i].parent;
      const Eigen::Affine3d local = parent < 0 ? figure_.rest[i] : figure_.rest[parent].inverse() * figure_.rest[i];
      const Eigen::Quaterniond turn = Eigen::Quaterniond(local.linear()).normalized();
      const Eigen::Vector3d& offset = local.translation();
      tinygltf::Node node;
      node.name = figure_.nodes[i].name;
      node.rotation = {turn.x(), turn.y(), turn.z(), turn.w()};
      node.translation = {offset.x(), offset.y(), offset.z()};
      model_.nodes.push_back(node);
      model_.nodes[parent + 1].children.push_back(static_cast<int>(i) + 1);
    }
    tinygltf::Node mesh;
    mesh.name = file_.name;
    mesh.mesh = 0;
    mesh.skin = 0;
    model_.nodes.push_back(mesh);
    tinygltf::Scene scene;
    scene.nodes = {0, static_cast<int>(model_.nodes.size()) - 1};
    model_.scenes.push_back(scene);
    model_.defaultScene = 0;
  }

  int mesh_node() const { return static_cast<int>(figure_.nodes.size()) + 1; }

  void add_mesh() {
    const SplitVertices split = split_vertices(file_.mesh);
    const auto normals = normals_of(file_.mesh, nullptr);
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.indices = buffer_.indices(split.corners);
    primitive.attributes["POSITION"] = buffer_.floats(
        spread(split, 3, [&](std::size_t v, int i) { return file_.mesh.vertices[v][i]; }), 3, true, kVertexTarget);
    primitive.attributes["NORMAL"] =
        buffer_.floats(spread(split, 3, [&](std::size_t v, int i) { return normals[v][i]; }), 3, false, kVertexTarget);
    primitive.attributes["_VERTEX"] = buffer_.floats(
        spread(split, 1, [](std::size_t v, int) { return static_cast<double>(v); }), 1, false, kVertexTarget);
    add_skin_weights(split, primitive);
    primitive.material = add_material(split, primitive);
    for (const Eigen::MatrixX3f& target : morphs_.targets)
      primitive.targets.push_back(add_target(split, normals, target));
    tinygltf::Mesh mesh;
    mesh.name = file_.name;
    mesh.primitives.push_back(primitive);
    mesh.weights.assign(morphs_.count(), 0.0);
    model_.meshes.push_back(mesh);
  }

  void add_skin_weights(const SplitVertices& split, tinygltf::Primitive& primitive) {
    std::vector<std::uint16_t> nodes;
    for (const int v : split.vertex)
      for (const int node : figure_.node[v]) nodes.push_back(static_cast<std::uint16_t>(node));
    primitive.attributes["JOINTS_0"] = buffer_.joints(nodes);
    primitive.attributes["WEIGHTS_0"] = buffer_.floats(
        spread(split, 4, [&](std::size_t v, int i) { return figure_.weight[v][i]; }), 4, false, kVertexTarget);
  }

  std::map<std::string, int> add_target(const SplitVertices& split, const std::vector<Eigen::Vector3d>& normals,
                                        const Eigen::MatrixX3f& target) {
    const auto moved = normals_of(file_.mesh, &target);
    const auto at = [&](std::size_t v, int i) { return target(static_cast<Eigen::Index>(v), i); };
    const auto turn = [&](std::size_t v, int i) { return moved[v][i] - normals[v][i]; };
    return {{"POSITION", buffer_.floats(spread(split, 3, at), 3, true, kVertexTarget)},
            {"NORMAL", buffer_.floats(spread(split, 3, turn), 3, false, kVertexTarget)}};
  }

  int add_material(const SplitVertices& split, tinygltf::Primitive& primitive) {
    const TriangleMesh& mesh = file_.mesh;
    tinygltf::Material material;
    material.name = file_.name;
    material.doubleSided = true;
    material.pbrMetallicRoughness.metallicFactor = 0.0;
    material.pbrMetallicRoughness.roughnessFactor = 0.9;
    if (!mesh.texture.empty() && !split.uv.empty() && split.uv[0] >= 0) {
      std::vector<float> uvs;
      for (const int uv : split.uv) {
        uvs.push_back(static_cast<float>(mesh.uvs[uv].x()));
        uvs.push_back(static_cast<float>(1.0 - mesh.uvs[uv].y()));  // glTF counts rows from the top
      }
      primitive.attributes["TEXCOORD_0"] = buffer_.floats(uvs, 2, false, kVertexTarget);
      material.pbrMetallicRoughness.baseColorTexture.index = add_texture();
    } else if (!mesh.colours.empty()) {
      primitive.attributes["COLOR_0"] = buffer_.floats(
          spread(split, 3, [&](std::size_t v, int i) { return mesh.colours[v][i]; }), 3, false, kVertexTarget);
    }
    model_.materials.push_back(material);
    return 0;
  }

  int add_texture() {
    std::vector<unsigned char> png;
    if (!cv::imencode(".png", file_.mesh.texture, png)) fail("OpenCV cannot encode the texture of '{}'", file_.name);
    tinygltf::Image image;
    image.name = file_.name;
    image.mimeType = "image/png";
    image.bufferView = buffer_.image(png);
    model_.images.push_back(image);
    tinygltf::Sampler sampler;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    model_.samplers.push_back(sampler);
    tinygltf::Texture texture;
    texture.source = 0;
    texture.sampler = 0;
    model_.textures.push_back(texture);
    return 0;
  }

  void add_skin() {
    tinygltf::Skin skin;
    skin.name = file_.name;
    skin.skeleton = 0;
    std::vector<float> inverse;
    for (std::size_t i = 0; i < figure_.nodes.size(); ++i) {
      skin.joints.push_back(static_cast<int>(i) + 1);
      const Eigen::Matrix4f matrix = figure_.rest[i].inverse().matrix().cast<float>();
      inverse.insert(inverse.end(), matrix.data(), matrix.data() + 16);  // both are column-major
    }
    skin.inverseBindMatrices = buffer_.floats(inverse, 16, false);
    model_.skins.push_back(skin);
  }

  void add_animation() {
    animation_.name = file_.name;
    for (std::size_t i = 0; i < figure_.nodes.size(); ++i) {
      std::vector<float> turns, offsets;
      for (const int key : tracks_.rotation_keys[i]) {
        const Eigen::Quaterniond& turn = tracks_.rotation[i][key];
        for (const double value : {turn.x(), turn.y(), turn.z(), turn.w()}) turns.push_back(static_cast<float>(value));
      }
      for (const int key : tracks_.translation_keys[i])
        for (int axis = 0; axis < 3; ++axis) offsets.push_back(static_cast<float>(tracks_.translation[i][key][axis]));
      add_channel(static_cast<int>(i) + 1, "rotation", tracks_.rotation_keys[i], turns, 4);
      add_channel(static_cast<int>(i) + 1, "translation", tracks_.translation_keys[i], offsets, 3);
    }
    if (morphs_.count() > 0) {
      std::vector<float> weights;
      for (const int key : tracks_.weight_keys)
        for (int k = 0; k < morphs_.count(); ++k) weights.push_back(static_cast<float>(tracks_.weights(key, k)));
      add_channel(mesh_node(), "weights", tracks_.weight_keys, weights, 1);
    }
    model_.animations.push_back(animation_);
  }

  /// The accessor of the times of keys; equal lists share one.
  int times_of(const std::vector<int>& keys) {
    if (const auto found = times_.find(keys); found != times_.end()) return found->second;
    std::vector<float> seconds;
    for (const int key : keys) seconds.push_back(static_cast<float>(key / file_.clip.frames_per_second));
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

  const FigureFile& file_;
  const Figure& figure_;
  const MorphTargets& morphs_;
  const FigureTracks& tracks_;
  tinygltf::Model model_;
  tinygltf::Animation animation_;
  std::map<std::vector<int>, int> times_;
  GlbBuffer buffer_;
};

}  // namespace

void write_glb(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks) {
  std::string bytes = GlbWriter(file, figure, morphs, tracks).bytes();
  if (bytes.size() > 0xFFFFFFFFULL)
    fail("{}: {} frames of {} bytes need {:.1f} GB, and a .glb file holds 4 GB; export fewer frames", path.string(),
         file.clip.num_frames(), bytes.size(), static_cast<double>(bytes.size()) / 1e9);
  write_atomically(path, bytes);
}

}  // namespace doppel
