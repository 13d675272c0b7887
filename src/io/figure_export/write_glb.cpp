#include <meshoptimizer.h>

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/glb_correctives.h"
#include "doppel/io/figure_export/glb_skeleton.h"
#include "doppel/io/figure_export/surface_normals.h"
#include "doppel/io/figure_export/vrm.h"
#include "doppel/io/figure_export/write_figure.h"
#include "doppel/io/scene/srgb.h"

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

/// Names of morph targets, which glTF itself does not have, in the form that programs know.
tinygltf::Value target_names(const std::vector<std::string>& names) {
  tinygltf::Value::Array list;
  for (const std::string& name : names) list.emplace_back(name);
  return tinygltf::Value(std::move(list));
}

/// Orders triangles so that neighbours follow each other, and vertices by where they are: a vertex then differs little
/// from the one before, which the compression needs.
void order_by_neighbours(const TriangleMesh& mesh, SplitVertices& split) {
  const std::size_t vertices = split.vertex.size(), corners = split.corners.size();
  const std::vector<float> positions = spread(split, 3, [&](std::size_t v, int i) { return mesh.vertices[v][i]; });
  std::vector<std::uint32_t> ordered(corners), new_index(vertices);
  meshopt_optimizeVertexCache(ordered.data(), split.corners.data(), corners, vertices);
  meshopt_spatialSortRemap(new_index.data(), positions.data(), vertices, 3 * sizeof(float));
  meshopt_remapIndexBuffer(split.corners.data(), ordered.data(), corners, new_index.data());
  for (std::vector<int>* values : {&split.vertex, &split.uv}) {
    const std::vector<int> before = *values;
    for (std::size_t v = 0; v < vertices; ++v) (*values)[new_index[v]] = before[v];
  }
}

class GlbWriter {
 public:
  GlbWriter(const FigureFile& file, const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks)
      : file_(file), figure_(figure), morphs_(morphs), buffer_(model_) {
    add_mesh();
    const bool avatar = !file.rights.authors.empty();
    if (avatar) check_avatar(figure, file.name, file.rights);
    const auto& standing = file.standing ? *file.standing : figure.rest;
    add_glb_skeleton(model_, buffer_, figure, file.name, avatar ? t_pose(figure) : standing);
    for (const ClipPart& part : file.clip.animations(file.name)) add_glb_animation(model_, buffer_, tracks, part);
    if (avatar) {
      model_.extensions["VRMC_vrm"] = vrm_extension(figure, file.name, file.rights, /*first_node=*/1);
      model_.extensionsUsed.emplace_back("VRMC_vrm");
    }
  }

  const tinygltf::Model& model() const { return model_; }

 private:
  void add_mesh() {
    SplitVertices split = split_vertices(file_.mesh);
    if (file_.compression) order_by_neighbours(file_.mesh, split);
    const auto normals = surface_normals(file_.mesh, nullptr);
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.indices = buffer_.indices(split.corners);
    primitive.attributes["POSITION"] = buffer_.floats(
        spread(split, 3, [&](std::size_t v, int i) { return file_.mesh.vertices[v][i]; }), 3, true, kVertexTarget);
    primitive.attributes["NORMAL"] =
        buffer_.floats(spread(split, 3, [&](std::size_t v, int i) { return normals[v][i]; }), 3, false, kVertexTarget);
    primitive.attributes["_VERTEX"] = buffer_.floats(
        spread(split, 1, [](std::size_t v, int) { return static_cast<double>(v); }), 1, false, kVertexTarget);
    add_glb_weights(buffer_, figure_, split.vertex, primitive);
    primitive.material = add_material(split, primitive);
    for (const Eigen::MatrixX3f& target : morphs_.targets)
      primitive.targets.push_back(add_target(split, normals, target));
    tinygltf::Mesh mesh;
    mesh.name = file_.name;
    mesh.primitives.push_back(primitive);
    mesh.weights.assign(morphs_.count(), 0.0);
    tinygltf::Value::Object extras;
    if (!morphs_.names.empty()) extras["targetNames"] = target_names(morphs_.names);
    if (file_.correctives) extras["correctives"] = corrective_extras(buffer_, *file_.correctives);
    if (file_.helpers) extras["helpers"] = helper_extras(buffer_, *file_.helpers);
    if (!extras.empty()) mesh.extras = tinygltf::Value(std::move(extras));
    model_.meshes.push_back(mesh);
  }

  std::map<std::string, int> add_target(const SplitVertices& split, const std::vector<Eigen::Vector3d>& normals,
                                        const Eigen::MatrixX3f& target) {
    const auto moved = surface_normals(file_.mesh, &target);
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
      primitive.attributes["COLOR_0"] =
          buffer_.floats(spread(split, 3, [&](std::size_t v, int i) { return linear_of_srgb(mesh.colours[v][i]); }), 3,
                         false, kVertexTarget);
    }
    model_.materials.push_back(material);
    return 0;
  }

  int add_texture() {
    std::vector<unsigned char> png;
    std::vector<int> options;  // OpenCV's own are for speed
    if (file_.compression)
      options = {cv::IMWRITE_PNG_COMPRESSION, 9, cv::IMWRITE_PNG_STRATEGY, cv::IMWRITE_PNG_STRATEGY_DEFAULT};
    if (!cv::imencode(".png", file_.mesh.texture, png, options))
      fail("OpenCV cannot encode the texture of '{}'", file_.name);
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

  const FigureFile& file_;
  const Figure& figure_;
  const MorphTargets& morphs_;
  tinygltf::Model model_ = empty_glb_model();
  GlbBuffer buffer_;
};

}  // namespace

void write_glb(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks) {
  write_glb_model(path, GlbWriter(file, figure, morphs, tracks).model(), file.compression);
}

}  // namespace doppel
