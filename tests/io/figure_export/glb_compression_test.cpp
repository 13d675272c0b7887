#include "doppel/io/figure_export/glb_compression.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "doppel/io/figure_export/compressed_figure.h"
#include "doppel/io/figure_export/write_figure.h"
#include "doppel/io/scene/read_scene.h"
#include "io/figure_export/waving_clip.h"
#include "support/gltf_pose.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"
#include "support/unpacked_glb.h"

namespace doppel::glb_compression_test {
namespace {

using support::GltfPose;
using support::GltfWriter;

constexpr int kFrames = 40;

/// The waving actor as a plain file, as a compressed one, and the latter unpacked by the test.
class CompressedGlb : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new support::TemporaryFolder;
    const Character& actor = test_actor();
    const FigureClip clip = support::waving_clip(actor, kFrames, 0.03);
    const Figure figure = make_figure(actor, BoneNames::skeletool);
    const MorphTargets morphs = fit_morphs(figure, actor.skeleton, clip, 8);
    const FigureTracks tracks = thin_tracks(figure, actor.skeleton, clip, morphs, 1e-4);
    FigureFile file{actor.name, actor.mesh, clip};
    write_glb(path("plain"), file, figure, morphs, tracks);
    packed_ = new CompressedFigure(compress_figure(figure, morphs, tracks));
    file.compression = packed_->steps;
    write_glb(path("packed"), file, packed_->figure, packed_->morphs, packed_->tracks);
    GltfWriter::write(path("unpacked"), support::unpacked_glb(read_file(path("packed"))));
  }
  static void TearDownTestSuite() {
    delete packed_;
    delete folder_;
  }
  static std::filesystem::path path(const std::string& name) { return *folder_ / (name + ".glb"); }

  static support::TemporaryFolder* folder_;
  static CompressedFigure* packed_;
};
support::TemporaryFolder* CompressedGlb::folder_ = nullptr;
CompressedFigure* CompressedGlb::packed_ = nullptr;

/// The vertices of a file in a pose, by the vertex of the template.
std::map<int, Eigen::Vector3d> by_vertex(const GltfPose& file, double seconds) {
  const auto index = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  const auto found = file.vertices(seconds);
  std::map<int, Eigen::Vector3d> result;
  for (std::size_t i = 0; i < found.size(); ++i) result[static_cast<int>(index[i][0])] = found[i];
  return result;
}

TEST_F(CompressedGlb, MovesAsThePlainFileWithinTheStatedError) {
  const GltfPose plain(path("plain")), unpacked(path("unpacked"));
  double worst = 0;
  for (int t = 0; t < kFrames; ++t) {
    const auto wanted = by_vertex(plain, t / 25.0), found = by_vertex(unpacked, t / 25.0);
    ASSERT_EQ(wanted.size(), found.size());
    for (const auto& [vertex, point] : wanted) worst = std::max(worst, 1000 * (found.at(vertex) - point).norm());
  }
  EXPECT_GT(worst, 0.0);
  EXPECT_LE(packed_->error.worst, 0.1);
  EXPECT_NEAR(worst, packed_->error.worst, 0.002);  // floats of the plain file
}

// The actor of the tests has few vertices, far from each other. Denser meshes are smaller.
TEST_F(CompressedGlb, HasAThirdOfTheBytesOfThePlainOne) {
  const auto bytes = [](const char* name) {
    return GltfPose(path(name)).json["buffers"][0]["byteLength"].get<std::size_t>();
  };
  EXPECT_LT(3 * bytes("packed"), bytes("plain"));
}

TEST_F(CompressedGlb, SaysWhatTheExtensionRequires) {
  const GltfPose packed(path("packed"));
  const auto extensions = nlohmann::json::array({"EXT_meshopt_compression", "KHR_mesh_quantization"});
  EXPECT_EQ(packed.json["extensionsRequired"], extensions);
  EXPECT_EQ(packed.json["extensionsUsed"], extensions);
  ASSERT_EQ(packed.json["buffers"].size(), 2U);
  EXPECT_FALSE(packed.json["buffers"][1].contains("uri"));
  EXPECT_EQ(packed.json["buffers"][1]["extensions"]["EXT_meshopt_compression"]["fallback"], true);
  std::size_t end = 0;
  for (const auto& view : packed.json["bufferViews"]) {
    if (!view.contains("extensions")) continue;
    EXPECT_EQ(view["buffer"], 1);
    EXPECT_GE(view["byteOffset"].get<std::size_t>(), end);
    end = view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>();
  }
  EXPECT_LE(end, packed.json["buffers"][1]["byteLength"].get<std::size_t>());
}

TEST_F(CompressedGlb, BoundsAreThoseOfTheRoundedNumbers) {
  const GltfPose unpacked(path("unpacked"));
  int checked = 0;
  for (std::size_t a = 0; a < unpacked.json["accessors"].size(); ++a) {
    const auto& accessor = unpacked.json["accessors"][a];
    if (!accessor.contains("min")) continue;
    const auto rows = unpacked.rows(static_cast<int>(a));
    for (std::size_t c = 0; c < rows[0].size(); ++c) {
      double least = rows[0][c], most = rows[0][c];
      for (const auto& row : rows) least = std::min(least, row[c]), most = std::max(most, row[c]);
      EXPECT_EQ(accessor["min"][c], least);
      EXPECT_EQ(accessor["max"][c], most);
      ++checked;
    }
  }
  EXPECT_GT(checked, 6);
}

TEST_F(CompressedGlb, TimesAndBindMatricesKeepTheirBits) {
  const GltfPose plain(path("plain")), unpacked(path("unpacked"));
  EXPECT_EQ(plain.rows(plain.json["skins"][0]["inverseBindMatrices"].get<int>()),
            unpacked.rows(unpacked.json["skins"][0]["inverseBindMatrices"].get<int>()));
  const auto& samplers = plain.json["animations"][0]["samplers"];
  for (std::size_t s = 0; s < samplers.size(); ++s)
    EXPECT_EQ(plain.rows(samplers[s]["input"].get<int>()),
              unpacked.rows(unpacked.json["animations"][0]["samplers"][s]["input"].get<int>()));
}

TEST_F(CompressedGlb, WeightsOfAVertexSumToOne) {
  const GltfPose unpacked(path("unpacked"));
  for (const auto& row : unpacked.rows(unpacked.primitive()["attributes"]["WEIGHTS_0"].get<int>()))
    EXPECT_EQ(row[0] + row[1] + row[2] + row[3], 1.0);
}

TEST_F(CompressedGlb, OurReaderFindsTheSameFigure) {
  const Scene plain = read_scene(path("plain")), packed = read_scene(path("packed"));
  EXPECT_EQ(packed.warnings, plain.warnings);
  ASSERT_EQ(packed.num_vertices(), plain.num_vertices());
  ASSERT_EQ(packed.num_faces(), plain.num_faces());
  const auto wanted = posed_vertices(plain, node_transforms(plain, plain.animations.at(0), 0.9)),
             found = posed_vertices(packed, node_transforms(packed, packed.animations.at(0), 0.9));
  double worst = 0;
  for (const Eigen::Vector3d& point : wanted) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& other : found) nearest = std::min(nearest, (other - point).norm());
    worst = std::max(worst, 1000 * nearest);
  }
  EXPECT_LE(worst, packed_->error.worst + 0.002);
}

TEST(GlbCompression, NumbersWithoutARoundedFormKeepTheirBits) {
  GltfWriter file;
  const float infinity = std::numeric_limits<float>::infinity();
  const int far = file.floats({0, 1, 2, 1e7F, 0.1F, 5}, "VEC3", 3),
            endless = file.floats({0, 0.3F, infinity}, "VEC3", 3);
  file.json["meshes"] = {
      {{"primitives",
        {{{"mode", 0}, {"attributes", {{"POSITION", far}}}}, {{"mode", 0}, {"attributes", {{"POSITION", endless}}}}}}}};
  const support::TemporaryFolder folder;
  GltfWriter::write(folder / "a.glb", support::unpacked_glb(compressed_glb(file.glb(), GlbSteps())));
  const GltfPose found(folder / "a.glb");
  EXPECT_EQ(found.rows(far)[1][0], 1e7);
  EXPECT_EQ(found.rows(far)[1][1], static_cast<double>(0.1F));
  EXPECT_EQ(found.rows(endless)[0][1], static_cast<double>(0.3F));
}

TEST(GlbCompression, AStepIsTheNearestMultiple) {
  EXPECT_EQ(round_to_step(0.3, 0.25), 0.25);
  EXPECT_EQ(round_to_step(-0.4, 0.25), -0.5);
  EXPECT_EQ(round_to_step(7.0, 0x1p-14), 7.0);
}

}  // namespace
}  // namespace doppel::glb_compression_test
