// Gaussians that a skeleton moves, read back by support/gltf_pose.h, which shares no code with the writer.
#include "doppel/actor/export/splat_rig.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>

#include "actor/export/dressed_actor.h"
#include "doppel/actor/export/splat_file.h"
#include "doppel/character/blend_skin.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/compressed_figure.h"
#include "support/gltf_pose.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"
#include "support/unpacked_glb.h"

namespace doppel::splat_rig_test {
namespace {

using support::GltfPose;
using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;
using torch::Tensor;
using Rows = std::vector<std::vector<double>>;

constexpr int kSize = 32, kFrames = 9;
constexpr double kRate = 30.0;

Tensor as_tensor(const std::vector<Eigen::Vector3d>& points) {
  const Tensor rows = torch::empty({1, static_cast<std::int64_t>(points.size()), 3});
  for (std::size_t i = 0; i < points.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      rows.data_ptr<float>()[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(points[i][axis]);
  return rows;
}

/// A character with Gaussians some millimetres beside its surface, and a motion.
struct Subject {
  Character character = make_test_character();
  RenderMesh mesh{character.mesh};
  TextureSpace space{mesh, kSize};
  Gaussians gaussians{nullptr};
  FigureClip clip;

  explicit Subject(SkinningMode mode, bool network = false) {
    const torch::NoGradGuard no_gradient;
    character.skinning = mode;
    GaussiansConfig config;
    config.size = kSize;
    config.lit = true;
    config.network = network;
    config.levels = 2;
    config.unet.width = 0.1;
    auto generator = at::detail::createCPUGenerator(5);
    const Tensor lighting = 0.3 * torch::randn({3, 9}, generator);
    gaussians = Gaussians(
        config,
        gaussian_texels(as_tensor(character.mesh.vertices)[0], space, torch::rand({kSize, kSize, 3}, generator)),
        lighting, generator);
    for (auto& named : gaussians->named_parameters(/*recurse=*/false))
      named.value().copy_(0.1 * torch::randn(named.value().sizes(), generator));
    gaussians->eval();
    clip.frames_per_second = kRate;
    for (int t = 0; t < kFrames; ++t) clip.dofs.push_back(dofs_at(t));
  }

  std::vector<double> dofs_at(int t) const {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 0; d < dofs.size() && t > 0; ++d) dofs[d] += 0.2 * std::sin(0.3 * t + static_cast<double>(d));
    return dofs;
  }
  Splats on(const std::vector<Eigen::Vector3d>& vertices) {
    const torch::NoGradGuard no_gradient;
    return gaussians->forward(surface_frames(as_tensor(vertices), mesh, gaussians->points()), std::nullopt);
  }
  SplatRig rig(BoneNames names = BoneNames::skeletool) {
    return make_splat_rig(character, character.mesh.vertices, mesh, gaussians, names);
  }
  SplatRig write(const std::filesystem::path& path) {
    SplatRig made = rig();
    write_splat_rig(path, "anna", made, thin_tracks(made.figure, character.skeleton, clip, {}, 0.0),
                    clip.animations("anna"));
    return made;
  }
};

Rows attribute(const GltfPose& file, const std::string& name) {
  return file.rows(file.primitive().at("attributes").at(name).get<int>());
}

/// The bones of a texel with their weights, by the character: the mean of its corners' weights by the barycentrics, of
/// which the four largest stay.
std::pair<std::vector<int>, std::vector<double>> bones_of(const Character& character, const TexelPoints& points,
                                                          std::int64_t texel) {
  std::map<int, double> sums;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(points.corners[texel][k].item<std::int64_t>());
    const auto& rows = character.skin.vertex_bones;
    for (auto i = static_cast<std::size_t>(rows.offsets[v]); i < static_cast<std::size_t>(rows.offsets[v + 1]); ++i)
      sums[rows.items[i]] += points.weights[texel][k].item<double>() * character.skin.weights[i];
  }
  std::vector<std::pair<double, int>> order;
  for (const auto& [bone, weight] : sums) order.emplace_back(-weight, bone);
  std::sort(order.begin(), order.end());
  order.resize(std::min<std::size_t>(order.size(), 4));
  double kept = 0.0;
  for (const auto& [weight, bone] : order) kept -= weight;
  std::pair<std::vector<int>, std::vector<double>> result;
  for (const auto& [weight, bone] : order) {
    result.first.push_back(bone);
    result.second.push_back(-weight / kept);
  }
  return result;
}

double mean_distance_mm(const std::vector<Eigen::Vector3d>& found, const Tensor& wanted) {
  double sum = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const float* at = wanted.data_ptr<float>() + 3 * i;
    sum += 1000.0 * (found[i] - Eigen::Vector3f(at).cast<double>()).norm();
  }
  return sum / static_cast<double>(found.size());
}

TEST(SplatRig, CentresMoveWithTheBonesOfTheirTexels) {
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  subject.write(folder / "a.glb");
  const GltfPose file(folder / "a.glb");
  const Splats rest = subject.on(subject.character.mesh.vertices);
  for (const int t : {0, 3, 8}) {
    const SkinBlend skin(bone_motions(subject.character, subject.dofs_at(t)), SkinningMode::linear);
    const auto found = file.vertices(t / kRate);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(subject.gaussians->points().texel.size(0)));
    for (std::size_t i = 0; i < found.size(); i += 7) {
      const auto texel = static_cast<std::int64_t>(i);
      const auto [bones, weights] = bones_of(subject.character, subject.gaussians->points(), texel);
      const Eigen::Vector3d centre =
          Eigen::Vector3f(rest.positions[0][texel].contiguous().data_ptr<float>()).cast<double>();
      EXPECT_LT((found[i] - skin.point(centre, bones, weights)).norm(), 2e-5) << "frame " << t << " texel " << i;
    }
  }
}

TEST(SplatRig, FollowsTheGaussiansOnTheSkinnedSurface) {
  // On the skinned mesh, Gaussians turn with the faces; in the file, with the blended bones. With dual quaternions, the
  // surface differs from the linear blend besides.
  for (const SkinningMode mode : {SkinningMode::linear, SkinningMode::dual_quaternion}) {
    const TemporaryFolder folder;
    Subject subject(mode);
    subject.write(folder / "a.glb");
    const GltfPose file(folder / "a.glb");
    const Tensor rest = subject.on(subject.character.mesh.vertices).positions;
    EXPECT_LT(mean_distance_mm(file.vertices(0.0), rest), 0.01);
    for (const int t : {2, 5, 8}) {
      const Tensor wanted = subject.on(posed_vertices(subject.character, subject.dofs_at(t))).positions;
      EXPECT_GT((wanted - rest).norm(2, 2).mean().item<double>(), 0.05);
      EXPECT_LT(mean_distance_mm(file.vertices(t / kRate), wanted), 2.0) << "frame " << t;
    }
  }
}

TEST(SplatRig, HoldsTheAttributesOfTheRestPose) {
  const TemporaryFolder folder;
  for (const bool network : {false, true}) {  // what a network predicts is left out
    Subject subject(SkinningMode::dual_quaternion, network);
    subject.write(folder / "rig.glb");
    write_splat_glb(folder / "rest.glb", subject.on(subject.character.mesh.vertices));
    const GltfPose rig(folder / "rig.glb"), rest(folder / "rest.glb");
    EXPECT_EQ(rig.json["extensionsUsed"], rest.json["extensionsUsed"]);
    EXPECT_EQ(rig.primitive()["extensions"], rest.primitive()["extensions"]);
    EXPECT_EQ(rig.primitive()["mode"], 0);
    for (const auto& [name, accessor] : rest.primitive()["attributes"].items())
      EXPECT_EQ(attribute(rig, name), attribute(rest, name)) << name;
    EXPECT_EQ(rig.primitive()["attributes"].size(), rest.primitive()["attributes"].size() + 2);
  }
}

TEST(SplatRig, WeightsSumToOneAndJointsAreInTheSkin) {
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  const SplatRig made = subject.write(folder / "a.glb");
  const GltfPose file(folder / "a.glb");
  const Rows joints = attribute(file, "JOINTS_0"), weights = attribute(file, "WEIGHTS_0");
  const auto bones = static_cast<double>(file.json["skins"][0]["joints"].size());
  EXPECT_EQ(bones, static_cast<double>(made.figure.nodes.size()));
  for (std::size_t i = 0; i < weights.size(); ++i) {
    EXPECT_NEAR(std::accumulate(weights[i].begin(), weights[i].end(), 0.0), 1.0, 1e-6);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_GE(weights[i][k], 0.0);
      EXPECT_LT(joints[i][k], bones);
    }
  }
  // The tube has texels with five bones: one of them is dropped, and the figure says so.
  EXPECT_GT(made.figure.largest_dropped_weight, 0.0);
  EXPECT_LT(made.figure.largest_dropped_weight, 0.2);
}

TEST(SplatRig, AccessorsHaveTheirBounds) {
  const TemporaryFolder folder;
  Subject(SkinningMode::linear).write(folder / "a.glb");
  const GltfPose file(folder / "a.glb");
  std::size_t bounded = 0;
  for (std::size_t a = 0; a < file.json["accessors"].size(); ++a) {
    const auto& accessor = file.json["accessors"][a];
    if (!accessor.contains("min")) continue;
    const Rows rows = file.rows(static_cast<int>(a));
    std::vector<double> least = rows[0], most = rows[0];
    for (const auto& row : rows)
      for (std::size_t c = 0; c < row.size(); ++c) {
        least[c] = std::min(least[c], row[c]);
        most[c] = std::max(most[c], row[c]);
      }
    EXPECT_EQ(accessor["min"].get<std::vector<double>>(), least) << a;
    EXPECT_EQ(accessor["max"].get<std::vector<double>>(), most) << a;
    ++bounded;
  }
  EXPECT_GE(bounded, 2U);  // the positions, and the times of keys
  EXPECT_TRUE(file.json["accessors"][file.primitive()["attributes"]["POSITION"].get<std::size_t>()].contains("min"));
}

TEST(SplatRig, GaussiansThatCannotBeWrittenTakeTheirWeightsAlong) {
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  SplatRig rig = subject.write(folder / "all.glb");
  rig.splats.opacities[0][2] = std::nanf("");
  write_splat_rig(folder / "a.glb", "anna", rig, FigureTracks(), {});
  const GltfPose all(folder / "all.glb"), file(folder / "a.glb");
  for (const char* name : {"POSITION", "JOINTS_0", "WEIGHTS_0"}) {
    Rows wanted = attribute(all, name);
    wanted.erase(wanted.begin() + 2);
    EXPECT_EQ(attribute(file, name), wanted) << name;
  }
  EXPECT_FALSE(file.json.contains("animations"));  // without frames
  rig.splats.opacities.fill_(std::nanf(""));
  EXPECT_THAT(message_of<Error>([&] { write_splat_rig(folder / "b.glb", "anna", rig, FigureTracks(), {}); }),
              ::testing::AllOf(HasSubstr("b.glb"), HasSubstr("there is no Gaussian to write")));
}

TEST(SplatRig, RefusesNamesThatDoNotFitTheBones) {
  Subject subject(SkinningMode::linear);
  EXPECT_THROW(subject.rig(BoneNames::mixamo), UsageError);
}

TEST(SplatRig, TheWriterSaysHowFarTheCentresAreOff) {
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  TrainedActor actor = support::dressed_actor();
  actor.character = subject.character;
  actor.gaussians = subject.gaussians;
  SplatRigReport report;
  const auto writer = make_splat_rig_writer(folder.path(), actor, {kRate, BoneNames::skeletool, 1e-4}, report);
  double mean = 0.0, worst = 0.0;
  for (const std::vector<double>& dofs : subject.clip.dofs) {
    const auto vertices = posed_vertices(subject.character, dofs);
    const Tensor rows = as_tensor(vertices), pose = torch::tensor(dofs).to(torch::kFloat32).unsqueeze(0);
    writer->write({{rows.data_ptr<float>(), static_cast<std::size_t>(rows.numel())}, pose});
    const Tensor off =
        1000.0 *
        (posed_centres(subject.rig(), subject.character.skeleton, dofs) - subject.on(vertices).positions[0]).norm(2, 1);
    mean += off.mean().item<double>() / kFrames;
    worst = std::max(worst, off.max().item<double>());
  }
  writer->close();
  EXPECT_EQ(report.gaussians, subject.gaussians->points().texel.size(0));
  EXPECT_EQ(report.figure.nodes, 5);
  EXPECT_GT(report.figure.keys, 10U);
  EXPECT_NEAR(report.figure.mean_error_mm, mean, 0.01);
  EXPECT_NEAR(report.figure.worst_error_mm, worst, 0.01);
  const GltfPose file(folder / "splats_rig.glb");
  const auto found = file.vertices((kFrames - 1) / kRate);
  EXPECT_LT(mean_distance_mm(found, posed_centres(subject.rig(), subject.character.skeleton, subject.clip.dofs.back())),
            0.5);  // the tolerance of the keys, along the chain
}

TEST(SplatRig, ACompressedFileMovesAsThePlainOne) {
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  const SplatRig rig = subject.rig();
  const FigureTracks tracks = thin_tracks(rig.figure, subject.character.skeleton, subject.clip, {}, 1e-4);
  const CompressedFigure packed = compress_figure(rig.figure, {}, tracks);
  const std::vector<ClipPart> animations = subject.clip.animations("anna");
  write_splat_rig(folder / "plain.glb", "anna", rig, tracks, animations);
  write_splat_rig(folder / "packed.glb", "anna", {rig.splats, packed.figure}, packed.tracks, animations, packed.steps);
  support::GltfWriter::write(folder / "unpacked.glb", support::unpacked_glb(read_file(folder / "packed.glb")));
  const GltfPose plain(folder / "plain.glb"), unpacked(folder / "unpacked.glb");
  const auto wanted = plain.vertices(1 / kRate), found = unpacked.vertices(1 / kRate);
  ASSERT_EQ(wanted.size(), found.size());
  for (std::size_t i = 0; i < wanted.size(); ++i)
    EXPECT_LE(1000 * (wanted[i] - found[i]).norm(), packed.error.worst + 0.002);
  EXPECT_LE(packed.error.worst, 0.1);
  const auto& attributes = plain.primitive()["attributes"];
  for (const auto& [name, accessor] : attributes.items()) {
    if (name == "POSITION" || name == "JOINTS_0") continue;
    const auto exact = plain.rows(accessor.get<int>()), rounded = unpacked.rows(accessor.get<int>());
    for (std::size_t i = 0; i < exact.size(); ++i)
      for (std::size_t c = 0; c < exact[i].size(); ++c) EXPECT_NEAR(rounded[i][c], exact[i][c], 0x1p-11) << name;
  }
  EXPECT_LT(2 * std::filesystem::file_size(folder / "packed.glb"), std::filesystem::file_size(folder / "plain.glb"));
}

TEST(SplatRig, TheWriterTakesTheSurfaceNearestToTheFrames) {
  // The actor's surface is two centimetres beside the template in every frame: the file holds it.
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  std::vector<Eigen::Vector3d> dressed = subject.character.mesh.vertices;
  for (Eigen::Vector3d& vertex : dressed) vertex.z() += 0.02;
  TrainedActor actor = support::dressed_actor();
  actor.character = subject.character;
  actor.gaussians = subject.gaussians;
  SplatRigReport report;
  const auto writer = make_splat_rig_writer(folder.path(), actor, {kRate, BoneNames::skeletool, 1e-4}, report);
  for (const std::vector<double>& dofs : subject.clip.dofs) {
    const SkinBlend skin(bone_motions(subject.character, dofs), SkinningMode::linear);
    const Tensor rows = as_tensor(skin.vertices(dressed, subject.character.skin));
    writer->write({{rows.data_ptr<float>(), static_cast<std::size_t>(rows.numel())},
                   torch::tensor(dofs).to(torch::kFloat32).unsqueeze(0)});
  }
  writer->close();
  EXPECT_LT(report.figure.mean_error_mm, 3.0);
  const GltfPose file(folder / "splats_rig.glb");
  const auto found = file.vertices(0.0);  // the rest pose
  EXPECT_LT(mean_distance_mm(found, subject.on(dressed).positions), 0.5);
  EXPECT_GT(mean_distance_mm(found, subject.on(subject.character.mesh.vertices).positions), 15.0);
}

TEST(SplatRig, TheExampleMovesCentresAndCovariances) {
  if (std::system("command -v node >/dev/null") != 0) GTEST_SKIP() << "node is missing";
  const TemporaryFolder folder;
  Subject subject(SkinningMode::linear);
  const SplatRig made = subject.write(folder / "a.glb");
  const int t = 5;
  const auto moved =
      blend_transforms(made.figure, pose_nodes(made.figure, subject.character.skeleton, subject.dofs_at(t)));
  for (const std::int64_t i : {0, 200}) {
    const std::string output = (folder / "out.json").string(),
                      command = fmt::format("node {} '{}' {} {} > '{}'", PLAY_SPLAT_RIG, (folder / "a.glb").string(),
                                            t / kRate, i, output);
    ASSERT_EQ(std::system(command.c_str()), 0);
    const nlohmann::json found = nlohmann::json::parse(read_file(output));
    const auto at = static_cast<std::size_t>(i);
    const Eigen::Vector3d centre = moved[at] * made.figure.rest_vertices[at];
    const Tensor q = made.splats.rotations[0][i].to(torch::kFloat64).contiguous(),
                 s = made.splats.log_scales[0][i].to(torch::kFloat64).exp().contiguous();
    const double* wxyz = q.data_ptr<double>();
    const Eigen::Matrix3d axes = moved[at].linear() *
                                 Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().matrix() *
                                 Eigen::Vector3d(s.data_ptr<double>()).asDiagonal(),
                          covariance = axes * axes.transpose();
    for (int r = 0, e = 0; r < 3; ++r) {
      EXPECT_NEAR(found["centre"][static_cast<std::size_t>(r)].get<double>(), centre[r], 2e-5);
      for (int c = r; c < 3; ++c, ++e)
        EXPECT_NEAR(found["covariance"][static_cast<std::size_t>(e)].get<double>(), covariance(r, c),
                    1e-4 * covariance.norm());
    }
  }
}

TEST(SplatRig, TheValidatorOfKhronosFindsNoError) {
  if (std::system(WEB_TESTS "/modules.sh") != 0) GTEST_SKIP() << "node or its packages are missing";
  const TemporaryFolder folder;
  Subject(SkinningMode::linear).write(folder / "a.glb");
  EXPECT_EQ(std::system(("node " WEB_TESTS "/validate_glb.mjs '" + (folder / "a.glb").string() + "'").c_str()), 0);
}

}  // namespace
}  // namespace doppel::splat_rig_test
