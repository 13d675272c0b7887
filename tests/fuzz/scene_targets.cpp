#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "doppel/geometry/mesh.h"
#include "doppel/io/scene/meshopt_view.h"
#include "doppel/io/scene/read_scene.h"
#include "fuzz/fuzz_target.h"
#include "fuzz/scene_oracle.h"
#include "support/fbx_writer.h"
#include "support/gltf_writer.h"
#include "support/packed_gltf.h"
#include "support/scan_files.h"

namespace doppel::fuzz {

namespace {

using support::coloured_box;
using support::GltfWriter;
using support::PlyForm;
using support::PlyUvs;
using support::PlyWriter;
using Path = std::filesystem::path;

/// Small, so that what a reader allocates beyond them is noticed.
constexpr SceneLimits kLimits{.vertices = 20'000, .triangles = 20'000, .nodes = 500, .keys = 20'000, .image_side = 512};

void read_files(std::string_view bytes, const Path& folder, const std::vector<const char*>& names) {
  check_scene(read_scene(spread(bytes, folder, names), kLimits), kLimits);
}

template <const char* kName>
void read_as(std::string_view bytes, const Path& folder) {
  read_files(bytes, folder, {kName});
}
template <const char* kName, const char* kSecond>
void read_two(std::string_view bytes, const Path& folder) {
  read_files(bytes, folder, {kName, kSecond});
}

constexpr char kGlb[] = "a.glb", kGltf[] = "a.gltf", kBuffer[] = "b.bin", kFbx[] = "a.fbx", kDae[] = "a.dae",
               kStl[] = "a.stl", kPly[] = "a.ply", kObj[] = "a.obj", kMtl[] = "a.mtl", kPng[] = "skin.png";

TriangleMesh box() { return coloured_box({-0.5, 0, 0}, {0.5, 2, 1}); }

/// A PNG of four colours.
std::vector<std::uint8_t> small_image() {
  cv::Mat image(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));
  image.at<cv::Vec3b>(0, 1) = {200, 100, 50};
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return bytes;
}

/// The arm with a texture, UVs, colours, a morph target and a sparse accessor.
GltfWriter rich_arm() {
  GltfWriter file = support::bending_arm();
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_0"] = file.floats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 2}, "VEC2", 2);
  primitive["attributes"]["COLOR_0"] = file.floats(std::vector<float>(18, 0.5F), "VEC3", 3);
  const int moves = file.floats(std::vector<float>(18, 0.1F), "VEC3", 3), rows = file.shorts({1, 4});
  const auto view_of = [&](int accessor) {
    return file.json["accessors"][static_cast<std::size_t>(accessor)]["bufferView"];
  };
  file.json["accessors"][static_cast<std::size_t>(moves)]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", view_of(rows)}, {"componentType", 5123}}},
      {"values", {{"bufferView", view_of(moves)}}}};
  primitive["targets"] = {{{"POSITION", moves}}};
  primitive["material"] = 0;
  file.json["meshes"][0]["weights"] = {0.5};
  file.json["images"] = {{{"bufferView", file.view(small_image())}, {"mimeType", "image/png"}}};
  file.json["textures"] = {{{"source", 0}}};
  file.json["materials"] = {
      {{"name", "cloth"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {1, 0.5, 0.5, 1}},
         {"baseColorTexture",
          {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {0.1, 0}}, {"scale", {3, 3}}}}}}}}}}}};
  return file;
}

/// The same file as JSON with its buffer in a second file.
std::string as_gltf(const GltfWriter& file) {
  const std::string glb = file.glb();
  std::uint32_t json_size = 0;
  std::memcpy(&json_size, glb.data() + 12, 4);
  auto json = GltfWriter::Json::parse(glb.substr(20, json_size));
  json["buffers"][0]["uri"] = kBuffer;
  return joined({json.dump(), glb.substr(20 + json_size + 8)});
}

FuzzTarget gltf_target(bool binary) {
  FuzzTarget target{binary ? "glb" : "gltf", binary ? read_as<kGlb> : read_two<kGltf, kBuffer>, {}, {}};
  if (binary) target.unwrap = unwrap_glb;
  for (const GltfWriter& file : {support::bending_arm(), rich_arm()})
    target.seeds.push_back(binary ? file.glb() : as_gltf(file));
  if (binary) {
    support::MeshoptPacking filtered;
    filtered.float_bits = filtered.rotation_bits = 12;
    target.seeds.push_back(support::meshopt_glb(support::bending_sleeve(), filtered));
    target.seeds.push_back(support::draco_glb(support::bending_sleeve()));
  }
  target.dictionary = {"\"sparse\":{\"count\":1}",
                       "\"mode\":\"INDICES\"",
                       "\"mode\":\"TRIANGLES\"",
                       "\"filter\":\"OCTAHEDRAL\"",
                       "\"filter\":\"QUATERNION\"",
                       "\"filter\":\"EXPONENTIAL\"",
                       "\"byteStride\":256,",
                       "\"buffer\":1",
                       "\"matrix\"",
                       "\"children\":[0]",
                       "\"children\":[1,2]",
                       "\"skin\":0",
                       "\"mesh\":0",
                       "{\"a\":",
                       "[[[[[[[[",
                       "\"mode\":5",
                       "\"mode\":6,",
                       "\"byteStride\":1,",
                       "\"count\":20000,",
                       "\"count\":60000000,",
                       "\"normalized\":true,",
                       "MAT4",
                       "SCALAR",
                       "VEC3",
                       "CUBICSPLINE",
                       "STEP",
                       "null",
                       "\"uri\":\"data:,AAAA\""};
  return target;
}

/// A compressed view: bytes of its mode and filter, stride and count, then the stream.
void read_meshopt_view(std::string_view bytes, const Path&) {
  constexpr const char* kModes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
  constexpr const char* kFilters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
  std::string head(bytes.substr(0, 4));
  head.resize(4);
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(head[i]); };
  MeshoptView view;
  view.stream = bytes.substr(std::min<std::size_t>(4, bytes.size()));
  view.mode = kModes[at(0) % 3];
  view.filter = kFilters[at(0) / 3 % 4];
  view.stride = 2 * std::size_t{at(1)};
  view.count = at(2) + 256 * std::size_t{at(3)};
  const UnpackedView result = unpack_meshopt(view);
  promise(result.bytes.size() <= 64 * view.stream.size(), "memory is bounded by the stream");
  promise(result.bytes.size() == (result.fault.empty() ? view.count * view.stride : 0), "all elements are there");
}

FuzzTarget meshopt_target() {
  const std::vector<float> values(33 * 4, 0.5F);
  const auto seed = [](unsigned char kind, unsigned char half_stride, unsigned char count, const auto& stream) {
    const std::string head{static_cast<char>(kind), static_cast<char>(half_stride), static_cast<char>(count), '\0'};
    return head + std::string(stream.begin(), stream.end());
  };
  const std::vector<std::uint32_t> corners{0, 1, 2, 2, 1, 3, 3, 1, 40};
  const auto attributes = support::packed_attributes(values.data(), 33, 8);
  return {"meshopt_view",
          read_meshopt_view,
          {seed(0, 8, 33, support::packed_attributes(values.data(), 33, 16)), seed(3, 4, 33, attributes),
           seed(6, 4, 33, attributes), seed(9, 4, 33, attributes),
           seed(1, 2, 9, support::packed_triangles(corners, 41)), seed(2, 1, 9, support::packed_sequence(corners, 41))},
          {"\xA0", "\xA1", "\xE0", "\xE1", "\xD0", "\xD1"}};
}

/// The sleeve with these bytes as the Draco stream of its primitive.
void read_draco_stream(std::string_view bytes, const Path& folder) {
  static const std::string kSleeve = support::draco_glb(support::bending_sleeve());
  std::uint32_t size = 0;
  std::memcpy(&size, kSleeve.data() + 12, 4);
  auto json = GltfWriter::Json::parse(kSleeve.substr(20, size));
  const std::string plain = kSleeve.substr(28 + size);
  json["bufferViews"].back()["byteOffset"] = plain.size();
  json["bufferViews"].back()["byteLength"] = bytes.size();
  json["buffers"][0] = {{"byteLength", plain.size() + bytes.size()}, {"uri", kBuffer}};
  read_files(joined({json.dump(), plain + std::string(bytes)}), folder, {kGltf, kBuffer});
}

FuzzTarget draco_target() {
  FuzzTarget target{"draco_stream", read_draco_stream, {}, {"DRACO\x02\x02\x01", "\x80\x80\x80\x80\x01"}};
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING})
    for (const int bits : {0, 11}) {
      support::DracoPacking packing{method, bits, [&](std::string& stream) { target.seeds.push_back(stream); }};
      support::draco_glb(support::bending_sleeve(), packing);
    }
  return target;
}

FuzzTarget fbx_target(bool binary) {
  FuzzTarget target{binary ? "fbx_binary" : "fbx_text", read_as<kFbx>, {}, {}};
  const FbxNode arm = support::fbx_arm();
  if (binary)
    target.seeds = {fbx_binary(arm, 7400, false), fbx_binary(arm, 7500, false), fbx_binary(arm, 7400, true)};
  else
    target.seeds = {support::fbx_text(arm)};
  target.dictionary = {"C: \"OO\",1,1\n",
                       "C: \"OO\",2,3\n",
                       "C: \"OO\",10,2\n",
                       "a: {",
                       "nan",
                       "inf",
                       "-inf",
                       "*9 { a: 1 }",
                       "P: \"RotationOrder\", \"enum\", \"\", \"\",1e300\n",
                       "P: \"Lcl Scaling\", \"\", \"\", \"A\",0,-1,nan\n",
                       "GeometricTranslation",
                       "PreRotation",
                       "ByVertice"};
  return target;
}

FuzzTarget collada_target() {
  const std::string plain = support::collada_file(box(), 0.01, "Z_UP");
  return {"collada",
          read_as<kDae>,
          {plain, support::collada_file(box(), 1, "Y_UP", "skin.png")},
          {"<node>", "</node>", "<node id=\"a\"><node><node>", "count=\"60000000\"", "stride=\"0\"", "offset=\"99\"",
           "<p>", "<vcount>3 4 5</vcount>", "<polylist>", "<instance_node url=\"#body\"/>", "set=\"9\"",
           "<matrix>1 2 3</matrix>"}};
}

FuzzTarget stl_target(bool binary) {
  return {binary ? "stl_binary" : "stl_text",
          read_as<kStl>,
          {binary ? support::stl_binary(box()) : support::stl_text(box())},
          {"solid ", "endsolid", "facet normal 0 0 1", "outer loop", "vertex 1 2 3\n", "endloop", "endfacet", "nan",
           std::string("\0\0\xC0\x7F", 4)}};
}

FuzzTarget ply_target(bool binary) {
  FuzzTarget target{binary ? "ply_binary" : "ply_text", read_as<kPly>, {}, {}};
  const TriangleMesh mesh = box();
  const auto forms = binary ? std::vector{PlyForm::little_endian, PlyForm::big_endian} : std::vector{PlyForm::text};
  for (const PlyForm form : forms)
    for (const PlyUvs uvs : {PlyUvs::none, PlyUvs::vertices, PlyUvs::corners})
      target.seeds.push_back(PlyWriter(mesh, form, uvs, "skin.png").file());
  target.dictionary = {"element vertex 60000000\n",
                       "element face 0\n",
                       "property list int int vertex_index\n",
                       "property list uchar float texcoord\n",
                       "property double x\n",
                       "element edge 3\n",
                       "end_header\n",
                       "format ascii 1.0\n",
                       "comment TextureFile ",
                       "property list uchar int vertex_indices\n",
                       "element vertex 0\n",
                       "property uchar red\n",
                       "property int texnumber\n"};
  return target;
}

/// The box as an OBJ file with UVs and colours. Each side has a material.
std::string obj_box() {
  std::string obj = "mtllib a.mtl\no box\n";
  const TriangleMesh mesh = box();
  for (const Eigen::Vector3d& x : mesh.vertices) obj += fmt::format("v {} {} {} 0.5 0.25 1\n", x.x(), x.y(), x.z());
  for (const Eigen::Vector2d& uv : mesh.uvs) obj += fmt::format("vt {} {}\n", uv.x(), uv.y());
  obj += "vn 0 0 1\n";
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (f % 6 == 0) obj += fmt::format("usemtl part_{}\n", f / 6);
    const Triangle face = mesh.faces[f];
    obj += fmt::format("f {0}/{0}/1 {1}/{1}/1 {2}/{2}/1\n", face[0] + 1, face[1] + 1, face[2] + 1);
  }
  return obj;
}

const std::vector<std::string> kObjWords{"f -1 -2 -3\n",
                                         "f 1//1 2//1 3//1\n",
                                         "f 1 2 3 4 5 6 7 8\n",
                                         "usemtl part_9\n",
                                         "g a b c\n",
                                         "s 1\n",
                                         "l 1 2\n",
                                         "\\\n",
                                         "v 1 2\n",
                                         "vt nan 0\n",
                                         "mtllib b.mtl\n",
                                         "map_Kd -s 1 1 1 a.png\n",
                                         "Kd 2 nan -1\n",
                                         "f 1/2/3/4 2 3\n",
                                         "usemtl",
                                         "newmtl"};

FuzzTarget obj_target() {
  const std::string materials = "newmtl part_0\nKd 0.2 0.4 0.6\nmap_Kd skin.png\nnewmtl part_1\nKd 1 0 0\n";
  return {"obj", read_two<kObj, kMtl>, {joined({obj_box(), materials})}, kObjWords};
}

/// An OBJ file with its material and texture as one mesh, which survives writing and reading.
void read_obj_mesh(std::string_view bytes, const Path& folder) {
  constexpr double kUnit = 0.001;
  const TriangleMesh mesh = read_obj(spread(bytes, folder, {kObj, kMtl, kPng}), kUnit);
  check_triangles(mesh);
  write_obj(folder / "again.obj", mesh, kUnit);
  const TriangleMesh again = read_obj(folder / "again.obj", kUnit);
  promise(again.faces == mesh.faces && again.face_uvs == mesh.face_uvs, "faces survive");
  promise(again.uvs == mesh.uvs && again.colours == mesh.colours, "UVs and colours survive");
  promise(again.texture.size() == mesh.texture.size(), "the texture survives");
  promise(again.num_vertices() == mesh.num_vertices(), "vertices survive");
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    promise((again.vertices[v] - mesh.vertices[v]).norm() <= 1e-12 * mesh.vertices[v].norm(), "positions survive");
}

FuzzTarget obj_mesh_target() {
  const std::vector<std::uint8_t> png = small_image();
  const std::string image(png.begin(), png.end()), material = "newmtl part_0\nKd 0.2 0.4 0.6\nmap_Kd skin.png\n";
  return {"obj_mesh", read_obj_mesh, {joined({obj_box(), material, image})}, kObjWords};
}

}  // namespace

std::vector<FuzzTarget> scene_targets() {
  return {gltf_target(true), gltf_target(false), fbx_target(true), fbx_target(false), collada_target(),
          stl_target(true),  stl_target(false),  ply_target(true), ply_target(false), obj_target(),
          obj_mesh_target(), meshopt_target(),   draco_target()};
}

}  // namespace doppel::fuzz
