#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"
#include "support/message_of.h"
#include "support/packed_gltf.h"
#include "support/temporary_folder.h"

namespace doppel::gltf_compression_test {
namespace {

using support::bending_sleeve;
using support::DracoPacking;
using support::GltfWriter;
using support::MeshoptPacking;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Json = GltfWriter::Json;

class GltfCompression : public ::testing::Test {
 protected:
  Scene read(const std::string& glb) const {
    GltfWriter::write(folder_ / "figure.glb", glb);
    return read_scene(folder_ / "figure.glb");
  }
  std::string refusal(const std::string& glb) const {
    return support::message_of<FileError>([&] { read(glb); });
  }
  support::TemporaryFolder folder_;
};

std::vector<Eigen::Vector3d> bent(const Scene& scene) {
  return posed_vertices(scene, node_transforms(scene, scene.animations.at(0), 0.7));
}

/// A corner of a triangle: where it is in the bent pose, its UV and its colour.
using Corner = Eigen::Matrix<double, 8, 1>;

std::vector<std::array<Corner, 3>> triangles_of(const Scene& scene) {
  const std::vector<Eigen::Vector3d> points = bent(scene);
  const ScenePrimitive& primitive = scene.primitives.at(0);
  std::vector<std::array<Corner, 3>> triangles;
  for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
    std::array<Corner, 3> triangle;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto v = static_cast<std::size_t>(primitive.faces[f][c]);
      const Eigen::Vector2d& uv = primitive.uvs.at(static_cast<std::size_t>(primitive.face_uvs[f][c]));
      triangle[c] << points.at(v), uv, primitive.colours.at(v);
    }
    triangles.push_back(triangle);
  }
  return triangles;
}

/// Largest difference of any number of a corner between two scenes with the same triangles in any order.
double difference(const Scene& plain, const Scene& packed) {
  const auto wanted = triangles_of(plain), found = triangles_of(packed);
  EXPECT_EQ(wanted.size(), found.size());
  double worst = 0;
  for (const auto& triangle : wanted) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& other : found)
      for (std::size_t turn = 0; turn < 3; ++turn) {
        double off = 0;
        for (std::size_t c = 0; c < 3; ++c)
          off = std::max(off, (triangle[c] - other[(c + turn) % 3]).cwiseAbs().maxCoeff());
        nearest = std::min(nearest, off);
      }
    worst = std::max(worst, nearest);
  }
  return worst;
}

TEST_F(GltfCompression, AMeshoptFileIsThePlainOne) {
  const Scene plain = read(bending_sleeve().glb());
  for (const char* mode : {"TRIANGLES", "INDICES"})
    for (const char* extension : {"EXT_meshopt_compression", "KHR_meshopt_compression", "MESHOPT_compression"}) {
      MeshoptPacking packing;
      packing.index_mode = mode;
      packing.extension = extension;
      const Scene packed = read(meshopt_glb(bending_sleeve(), packing));
      EXPECT_EQ(difference(plain, packed), 0.0) << mode;
      EXPECT_THAT(packed.warnings, IsEmpty());
    }
}

// A float of b bits in the filter is off by 2^-(b-1) of its size, a component of a rotation of 16 bits by 2^-16. The
// largest size is 2 m, and errors of weights, targets and matrices add to that of the position.
TEST_F(GltfCompression, FiltersOfMeshoptLoseTheirBitsAlone) {
  const Scene plain = read(bending_sleeve().glb());
  MeshoptPacking packing;
  packing.float_bits = 16;
  packing.rotation_bits = 16;
  const double off = difference(plain, read(meshopt_glb(bending_sleeve(), packing)));
  EXPECT_GT(off, 0.0);
  EXPECT_LT(off, 4 * 2 * 0x1p-15);
}

TEST_F(GltfCompression, MeshoptViewsAreNotNeededWhereTheirBytesStandPlainToo) {
  const GltfWriter sleeve = bending_sleeve();
  const Scene plain = read(sleeve.glb());
  support::GlbParts parts(sleeve);
  for (auto& view : parts.json["bufferViews"])
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}, {"byteLength", 1}, {"count", 6}};
  EXPECT_EQ(difference(plain, read(parts.glb())), 0.0);
}

TEST_F(GltfCompression, DamagedMeshoptStreamsAreNamed) {
  const auto refusal_of = [&](const std::function<void(Json&)>& change) {
    MeshoptPacking packing;
    packing.change = change;
    return refusal(meshopt_glb(bending_sleeve(), packing));
  };
  // View 6 holds the positions of the sleeve.
  const auto refusal_with = [&](const char* member, const Json& value) {
    return refusal_of([&](Json& json) {
      for (auto& view : json["bufferViews"]) view["extensions"]["EXT_meshopt_compression"][member] = value;
    });
  };
  EXPECT_THAT(refusal_with("byteLength", 40),
              AllOf(HasSubstr("figure.glb"), HasSubstr("bufferViews["), HasSubstr("truncated or damaged")));
  EXPECT_THAT(refusal_with("byteLength", 1e9), HasSubstr("meshopt_compression covers the bytes"));
  EXPECT_THAT(refusal_with("byteOffset", -1), HasSubstr("meshopt_compression covers the bytes"));
  EXPECT_THAT(refusal_with("buffer", 1), HasSubstr("but its buffer has 0"));
  EXPECT_THAT(refusal_with("buffer", 7), HasSubstr("but the file has 2 of them"));
  EXPECT_THAT(refusal_with("count", 900'000'000), HasSubstr("compressed ones can hold"));
  EXPECT_THAT(refusal_with("count", 2.5), HasSubstr("count is 2.5"));
  EXPECT_THAT(refusal_with("mode", "POINTS"), HasSubstr("'POINTS'"));
  EXPECT_THAT(refusal_with("filter", "COLOR"), HasSubstr("gltfpack -c"));
  EXPECT_THAT(refusal_of([](Json& json) {
                for (auto& accessor : json["accessors"]) accessor["count"] = 1000;
              }),
              HasSubstr("bytes, but its view has"));
}

// What gltfpack makes of positions, joints and UVs: integers, whose scale stands in the inverse bind matrices and in
// the material.
TEST_F(GltfCompression, QuantisedFilesAreWithinHalfAStep) {
  GltfWriter file = bending_sleeve();
  const support::GlbParts parts(file);
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  const auto accessor = [&](const Json& index) -> const Json& {
    return parts.json["accessors"][index.get<std::size_t>()];
  };
  const auto quantised = [&](const Json& index, double scale, double shift) {
    std::vector<std::uint16_t> numbers;
    for (const float value : parts.floats_of(accessor(index)))
      numbers.push_back(static_cast<std::uint16_t>(std::lround((static_cast<double>(value) + shift) / scale * 65535)));
    const int made = file.shorts(numbers);
    auto& entry = file.json["accessors"][static_cast<std::size_t>(made)];
    entry["type"] = accessor(index)["type"];
    entry["count"] = accessor(index)["count"];
    entry["normalized"] = true;
    return made;
  };
  primitive["attributes"]["POSITION"] = quantised(primitive["attributes"]["POSITION"], 2.5, 0.25);
  primitive["attributes"]["TEXCOORD_0"] = quantised(primitive["attributes"]["TEXCOORD_0"], 1.5, 0.0);
  primitive["attributes"]["WEIGHTS_0"] = quantised(primitive["attributes"]["WEIGHTS_0"], 1.0, 0.0);
  std::vector<float> moves = parts.floats_of(accessor(primitive["targets"][0]["POSITION"]));
  for (float& move : moves) move /= 2.5F;  // no shift: it is a difference
  primitive["targets"][0]["POSITION"] = file.floats(moves, "VEC3", 3);
  std::vector<float> matrices = parts.floats_of(accessor(file.json["skins"][0]["inverseBindMatrices"]));
  for (std::size_t m = 0; m < matrices.size(); m += 16) {
    Eigen::Map<Eigen::Matrix4f> matrix(&matrices[m]);
    matrix = (matrix * (Eigen::Translation3f(-0.25F, -0.25F, -0.25F) * Eigen::Scaling(2.5F)).matrix()).eval();
  }
  file.json["skins"][0]["inverseBindMatrices"] = file.floats(matrices, "MAT4", 16);
  file.json["materials"] = {
      {{"pbrMetallicRoughness",
        {{"baseColorTexture",
          {{"index", 0},
           {"texCoord", 5},
           {"extensions", {{"KHR_texture_transform", {{"scale", {1.5, 1.5}}, {"texCoord", 0}}}}}}}}}}};
  file.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
  file.json["images"] = Json::array({Json::object()});
  primitive["material"] = 0;
  file.json["extensionsRequired"] = {"KHR_mesh_quantization", "KHR_texture_transform"};
  const Scene packed = read(meshopt_glb(file));
  EXPECT_LT(difference(read(bending_sleeve().glb()), packed), 2 * 2.5 / 65535);
  EXPECT_THAT(packed.warnings, Contains(AllOf(HasSubstr("KTX2"), HasSubstr("PNG, JPEG or WebP"))));
}

TEST_F(GltfCompression, ADracoFileIsThePlainOne) {
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    GltfWriter sleeve = bending_sleeve();
    if (method == draco::MESH_EDGEBREAKER_ENCODING) sleeve.json["meshes"][0]["primitives"][0].erase("targets");
    const Scene plain = read(sleeve.glb());
    DracoPacking packing;
    packing.method = method;
    EXPECT_EQ(difference(plain, read(draco_glb(sleeve, packing))), 0.0);
    packing.position_bits = 11;  // of the longest side of the box, 2 m
    const double off = difference(plain, read(draco_glb(sleeve, packing)));
    EXPECT_GT(off, 0.0);
    EXPECT_LT(off, 2.0 / 2047);
  }
}

TEST_F(GltfCompression, ADracoStreamIsNotNeededWhereTheVerticesStandPlainToo) {
  GltfWriter file = support::bending_arm();
  file.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
  EXPECT_EQ(read(file.glb()).num_vertices(), 6);
}

TEST_F(GltfCompression, ADracoPrimitiveOfSeveralNodesIsReadForEach) {
  GltfWriter twice = bending_sleeve();
  twice.json["nodes"].push_back({{"name", "other"}, {"mesh", 0}, {"skin", 0}});
  EXPECT_EQ(read(draco_glb(twice)).num_vertices(), 2 * 63);
}

TEST_F(GltfCompression, DamagedDracoStreamsAreNamed) {
  const auto refusal_of = [&](const std::function<void(std::string&)>& change) {
    DracoPacking packing;
    packing.change = change;
    return refusal(draco_glb(bending_sleeve(), packing));
  };
  const auto where = AllOf(HasSubstr("figure.glb"), HasSubstr("Draco stream of meshes[0].primitives[0]"));
  EXPECT_THAT(refusal_of([](std::string& stream) { stream.resize(stream.size() / 2); }),
              AllOf(where, HasSubstr("truncated or damaged")));
  EXPECT_THAT(refusal_of([](std::string& stream) { stream.resize(12); }), AllOf(where, HasSubstr("truncated")));
  EXPECT_THAT(refusal_of([](std::string& stream) { stream[0] = 'X'; }),
              AllOf(where, HasSubstr("does not begin as one")));
  EXPECT_THAT(refusal_of([](std::string& stream) { stream[6] = 1; }), AllOf(where, HasSubstr("version 2.1")));
  EXPECT_THAT(refusal_of([](std::string& stream) { stream[7] = 0; }), AllOf(where, HasSubstr("points")));
  // The two counts behind the kind of traversal, as the format writes numbers: seven bits a byte.
  EXPECT_THAT(refusal_of([](std::string& stream) { stream.replace(12, 1, "\x80\x80\x80\x80\x01"); }),
              AllOf(where, HasSubstr("vertices, but its accessors")));
}

TEST_F(GltfCompression, ADracoStreamHoldsNoMoreThanTheAccessorsSay) {
  for (const char* what : {"vertices", "triangles"}) {
    GltfWriter sleeve = bending_sleeve();
    const auto& primitive = sleeve.json["meshes"][0]["primitives"][0];
    const Json& index = std::string(what) == "vertices" ? primitive["attributes"]["POSITION"] : primitive["indices"];
    const support::GlbParts parts(sleeve);
    std::string glb = draco_glb(sleeve);
    const std::string count = std::string(what) == "vertices" ? "\"count\":63" : "\"count\":288";
    const auto accessor = "accessors[" + std::to_string(index.get<int>()) + "]";
    for (std::size_t at = glb.find(count); at != std::string::npos; at = glb.find(count, at + 1))
      glb.replace(at, count.size(), std::string(what) == "vertices" ? "\"count\":62" : "\"count\":285");
    EXPECT_THAT(refusal(glb), HasSubstr(std::string(what) + ", but its accessors and its size allow")) << accessor;
  }
}

TEST_F(GltfCompression, AttributesThatTheDracoStreamLacksAreNamed) {
  std::string glb = draco_glb(bending_sleeve());
  const std::string names = "\"KHR_draco_mesh_compression\":{\"attributes\":{\"COLOR_0\":0";
  ASSERT_NE(glb.find(names), std::string::npos);
  glb.replace(glb.find(names) + names.size() - 1, 1, "9");
  EXPECT_THAT(refusal(glb), HasSubstr("lacks the attribute 9 (COLOR_0)"));
}

}  // namespace
}  // namespace doppel::gltf_compression_test
