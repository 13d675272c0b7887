#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"
#include "support/gltf_writer.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::gltf_extensions_test {
namespace {

using support::bending_arm;
using support::GltfWriter;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class GltfExtensions : public ::testing::Test {
 protected:
  Scene read(const GltfWriter& file) {
    file.write(folder_ / "figure.glb");
    return read_scene(folder_ / "figure.glb");
  }
  std::string refusal(const GltfWriter& file) {
    return support::message_of<FileError>([&] { read(file); });
  }
  static GltfWriter requiring(const std::vector<std::string>& names) {
    GltfWriter file = bending_arm();
    file.json["extensionsRequired"] = names;
    return file;
  }
  support::TemporaryFolder folder_;
};

TEST_F(GltfExtensions, ACompressionIsNamed) {
  for (const auto& [extension, method] : {std::pair("EXT_meshopt_compression", "meshopt"),
                                          {"KHR_meshopt_compression", "meshopt"},
                                          {"KHR_draco_mesh_compression", "Draco"}})
    EXPECT_THAT(refusal(requiring({extension})),
                AllOf(HasSubstr(std::string("compressed by ") + method), HasSubstr("export it without compression"),
                      HasSubstr(extension)));
}

TEST_F(GltfExtensions, AllThatIsRequiredAndNotReadIsNamed) {
  EXPECT_THAT(refusal(requiring({"KHR_texture_transform", "EXT_mesh_gpu_instancing", "VENDOR_shape"})),
              AllOf(HasSubstr("EXT_mesh_gpu_instancing, VENDOR_shape"), ::testing::Not(HasSubstr("KHR_texture"))));
  EXPECT_THAT(refusal(requiring({"KHR_texture_basisu", "EXT_meshopt_compression"})),
              HasSubstr("KHR_texture_basisu, EXT_meshopt_compression"));
  EXPECT_THAT(read(requiring({"KHR_texture_basisu", "KHR_materials_unlit", "VRM"})).warnings,
              Contains(HasSubstr("KHR_texture_basisu, KHR_materials_unlit, VRM")));
  EXPECT_THAT(read(requiring({"KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp"})).warnings,
              IsEmpty());
  GltfWriter file = bending_arm();
  file.json["extensionsUsed"] = {"VENDOR_shape"};
  EXPECT_THAT(read(file).warnings, IsEmpty()) << "what is only used may be left out";
  file.json["extensionsRequired"] = {7};
  EXPECT_THAT(refusal(file), HasSubstr("extensionsRequired holds 7"));
}

// Compressed views point at a second buffer, which holds nothing or what they become.
TEST_F(GltfExtensions, CompressedViewsAreReadWhereTheFileHasThemPlainToo) {
  GltfWriter file = bending_arm();
  for (auto& view : file.json["bufferViews"])
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 1}, {"count", 6}};
  EXPECT_EQ(read(file).num_vertices(), 6);
}

TEST_F(GltfExtensions, ABufferThatOnlyCompressionFillsIsNamed) {
  // A text file, so that the buffers can be set.
  GltfWriter file = bending_arm();
  for (auto& view : file.json["bufferViews"])
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 1}, {"count", 6}};
  file.json["buffers"] = {{{"byteLength", 4096}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  GltfWriter::write(folder_ / "figure.gltf", file.json.dump());
  EXPECT_THAT(support::message_of<FileError>([&] { read_scene(folder_ / "figure.gltf"); }),
              HasSubstr("is compressed by meshopt"));
}

TEST_F(GltfExtensions, DracoIsRefusedWhereTheVerticesHaveNoOtherData) {
  GltfWriter file = bending_arm();
  file.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
  EXPECT_EQ(read(file).num_vertices(), 6);
  file.json["accessors"][0].erase("bufferView");
  EXPECT_THAT(refusal(file), HasSubstr("compressed by Draco"));
}

}  // namespace
}  // namespace doppel::gltf_extensions_test
