#include "doppel/io/figure_export/fbx_surface.h"

#include <opencv2/imgcodecs.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/surface_normals.h"

namespace doppel {
namespace {

constexpr const char* kUvSet = "UVMap";
constexpr float kNotMoved = 1e-7F;  // metres

/// A float as double: its low bits are zero and compress well.
double float_rounded(double value) { return static_cast<double>(static_cast<float>(value)); }

void append_rounded(std::vector<double>& values, const Eigen::Vector3d& vector) {
  for (int i = 0; i < 3; ++i) values.push_back(float_rounded(vector[i]));
}

FbxNode fbx_whole(const char* name, std::int32_t value) { return {name, {value}, {}}; }
FbxNode fbx_word(const char* name, const std::string& value) { return {name, {value}, {}}; }

/// The last corner of a polygon is written as -(vertex + 1).
FbxNode polygons(const TriangleMesh& mesh) {
  std::vector<std::int32_t> corners;
  for (const Triangle& face : mesh.faces) corners.insert(corners.end(), {face[0], face[1], -(face[2] + 1)});
  return {"PolygonVertexIndex", {std::move(corners)}, {}};
}

std::vector<std::int32_t> flat_corners(const std::vector<Triangle>& triangles) {
  std::vector<std::int32_t> values;
  for (const Triangle& triangle : triangles) values.insert(values.end(), triangle.begin(), triangle.end());
  return values;
}

/// A layer of values, such as normals. @param mapping what has a value @param data arrays of the values
FbxNode layer_element(const char* kind, const std::string& name, const char* mapping, const char* reference,
                      int version, std::vector<FbxNode> data) {
  FbxNode layer{kind,
                {0},
                {fbx_whole("Version", version), fbx_word("Name", name), fbx_word("MappingInformationType", mapping),
                 fbx_word("ReferenceInformationType", reference)}};
  for (FbxNode& array : data) layer.children.push_back(std::move(array));
  return layer;
}

FbxNode normal_layer(const TriangleMesh& mesh) {
  const auto normals = surface_normals(mesh, nullptr);
  std::vector<double> values;
  for (const Triangle& face : mesh.faces)
    for (const int v : face) append_rounded(values, normals[as_size(v)]);
  return layer_element("LayerElementNormal", "", "ByPolygonVertex", "Direct", 101,
                       {{"Normals", {std::move(values)}, {}}});
}

FbxNode uv_layer(const TriangleMesh& mesh) {
  std::vector<double> values;
  for (const Eigen::Vector2d& uv : mesh.uvs) values.insert(values.end(), {uv.x(), uv.y()});
  return layer_element("LayerElementUV", kUvSet, "ByPolygonVertex", "IndexToDirect", 101,
                       {{"UV", {std::move(values)}, {}}, {"UVIndex", {flat_corners(mesh.face_uvs)}, {}}});
}

FbxNode colour_layer(const TriangleMesh& mesh) {
  std::vector<double> values;
  for (const Eigen::Vector3d& colour : mesh.colours)
    values.insert(values.end(), {colour.x(), colour.y(), colour.z(), 1.0});
  return layer_element("LayerElementColor", "Col", "ByPolygonVertex", "IndexToDirect", 101,
                       {{"Colors", {std::move(values)}, {}}, {"ColorIndex", {flat_corners(mesh.faces)}, {}}});
}

bool has_uvs(const TriangleMesh& mesh) { return !mesh.uvs.empty() && !mesh.face_uvs.empty(); }
bool has_texture(const TriangleMesh& mesh) { return has_uvs(mesh) && !mesh.texture.empty(); }

std::vector<FbxNode> layers_of(const TriangleMesh& mesh) {
  std::vector<FbxNode> layers{normal_layer(mesh)};
  if (has_uvs(mesh)) layers.push_back(uv_layer(mesh));
  if (!has_texture(mesh) && !mesh.colours.empty()) layers.push_back(colour_layer(mesh));
  // Smoothing groups, all the same: some programs complain about a file without.
  layers.push_back(layer_element("LayerElementSmoothing", "", "ByPolygon", "Direct", 102,
                                 {{"Smoothing", {std::vector<std::int32_t>(mesh.faces.size(), 1)}, {}}}));
  layers.push_back(layer_element("LayerElementMaterial", "", "AllSame", "IndexToDirect", 101,
                                 {{"Materials", {std::vector<std::int32_t>{0}}, {}}}));
  FbxNode list{"Layer", {0}, {fbx_whole("Version", 100)}};
  for (const FbxNode& layer : layers)
    list.children.push_back({"LayerElement", {}, {fbx_word("Type", layer.name), fbx_whole("TypedIndex", 0)}});
  layers.push_back(std::move(list));
  return layers;
}

/// The vertices that a target moves, with displacements and changes of the normals.
std::vector<FbxNode> shape_records(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& normals,
                                   const Eigen::MatrixX3f& target) {
  const auto moved = surface_normals(mesh, &target);
  std::vector<std::int32_t> indices;
  std::vector<double> offsets, turns;
  for (Eigen::Index v = 0; v < target.rows(); ++v) {
    if (target.row(v).cwiseAbs().maxCoeff() < kNotMoved) continue;
    indices.push_back(static_cast<std::int32_t>(v));
    append_rounded(offsets, kFbxUnitsPerMetre * target.row(v).cast<double>().transpose());
    append_rounded(turns, moved[as_size(v)] - normals[as_size(v)]);
  }
  return {fbx_whole("Version", 100),
          {"Indexes", {std::move(indices)}, {}},
          {"Vertices", {std::move(offsets)}, {}},
          {"Normals", {std::move(turns)}, {}}};
}

void embed_texture(FbxDocument& document, std::int64_t material, const FigureFile& file, const std::string& image) {
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", file.mesh.texture, png)) fail("OpenCV cannot encode the texture of '{}'", file.name);
  const std::int64_t video = document.add("Video", file.name, "Video", "Clip",
                                          {fbx_word("Type", "Clip"),
                                           properties70({property70("Path", "KString", "XRefUrl", "", {image})}),
                                           fbx_whole("UseMipMap", 0),
                                           fbx_word("Filename", image),
                                           fbx_word("RelativeFilename", image),
                                           {"Content", {FbxBytes{std::string(png.begin(), png.end())}}, {}}});
  const std::int64_t texture = document.add(
      "Texture", file.name, "Texture", "",
      {fbx_word("Type", "TextureVideoClip"),
       fbx_whole("Version", 202),
       fbx_word("TextureName", fbx_object_name(file.name, "Texture")),
       properties70({property70("UVSet", "KString", "", "", {kUvSet}), property70("UseMaterial", "bool", "", "", {1})}),
       fbx_word("Media", fbx_object_name(file.name, "Video")),
       fbx_word("FileName", image),
       fbx_word("RelativeFilename", image),
       {"ModelUVTranslation", {0.0, 0.0}, {}},
       {"ModelUVScaling", {1.0, 1.0}, {}},
       fbx_word("Texture_Alpha_Source", "None"),
       {"Cropping", {0, 0, 0, 0}, {}}});
  document.connect(video, texture);
  document.connect(texture, material, "DiffuseColor");
}

}  // namespace

std::int64_t add_fbx_geometry(FbxDocument& document, const FigureFile& file, const Figure& figure) {
  std::vector<double> vertices;
  for (const Eigen::Vector3d& vertex : figure.rest_vertices) append_rounded(vertices, kFbxUnitsPerMetre * vertex);
  std::vector<FbxNode> records{
      fbx_whole("GeometryVersion", 124), {"Vertices", {std::move(vertices)}, {}}, polygons(file.mesh)};
  for (FbxNode& layer : layers_of(file.mesh)) records.push_back(std::move(layer));
  return document.add("Geometry", file.name, "Geometry", "Mesh", std::move(records));
}

std::int64_t add_fbx_material(FbxDocument& document, const FigureFile& file, const std::string& image) {
  const auto number = [](const char* name, double value) { return property70(name, "Number", "", "A", {value}); };
  const auto colour = [](const char* name, double grey) {
    return property70(name, "Color", "", "A", {grey, grey, grey});
  };
  const std::int64_t material = document.add(
      "Material", file.name, "Material", "",
      {fbx_whole("Version", 102), fbx_word("ShadingModel", "lambert"), fbx_whole("MultiLayer", 0),
       properties70({colour("DiffuseColor", 1.0), number("DiffuseFactor", 1.0), colour("AmbientColor", 0.0),
                     colour("EmissiveColor", 0.0), number("EmissiveFactor", 0.0), number("SpecularFactor", 0.0),
                     number("Opacity", 1.0)})});
  if (has_texture(file.mesh)) embed_texture(document, material, file, image);
  return material;
}

std::vector<std::int64_t> add_fbx_shapes(FbxDocument& document, std::int64_t geometry, const FigureFile& file,
                                         const MorphTargets& morphs) {
  std::vector<std::int64_t> channels;
  if (morphs.count() == 0) return channels;
  const std::int64_t blend = document.add("Deformer", file.name, "Deformer", "BlendShape", {fbx_whole("Version", 100)});
  document.connect(blend, geometry);
  const auto normals = surface_normals(file.mesh, nullptr);
  for (std::size_t k = 0; k < morphs.targets.size(); ++k) {
    const std::string name = fmt::format("Shape_{}", k);
    channels.push_back(document.add("Deformer", name, "SubDeformer", "BlendShapeChannel",
                                    {fbx_whole("Version", 100),
                                     {"DeformPercent", {0.0}, {}},
                                     {"FullWeights", {std::vector<double>{100.0}}, {}},
                                     properties70({property70("DeformPercent", "Number", "", "A", {0.0})})}));
    document.connect(channels.back(), blend);
    const std::int64_t shape =
        document.add("Geometry", name, "Geometry", "Shape", shape_records(file.mesh, normals, morphs.targets[k]));
    document.connect(shape, channels.back());
  }
  return channels;
}

}  // namespace doppel
