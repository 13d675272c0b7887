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

TEST_F(GltfExtensions, AllThatIsRequiredAndNotReadIsNamed) {
  EXPECT_THAT(refusal(requiring({"KHR_texture_transform", "EXT_mesh_gpu_instancing", "VENDOR_shape"})),
              AllOf(HasSubstr("EXT_mesh_gpu_instancing, VENDOR_shape"), ::testing::Not(HasSubstr("KHR_texture"))));
  EXPECT_THAT(refusal(requiring({"KHR_texture_basisu", "EXT_meshopt_compression", "VENDOR_shape"})),
              HasSubstr("KHR_texture_basisu, VENDOR_shape"));
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

}  // namespace
}  // namespace doppel::gltf_extensions_test
