#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "doppel/character/blend_skin.h"
#include "doppel/io/figure_export/write_figure.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/scene/read_scene.h"
#include "io/figure_export/waving_clip.h"
#include "support/gltf_pose.h"
#include "support/message_of.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::write_glb_test {
namespace {

using support::GltfPose;
using support::TemporaryFolder;
using support::waving_clip;

struct Exported {
  Figure figure;
  MorphTargets morphs;
  FigureTracks tracks;
  FigureError error;
};

Exported export_glb(const std::filesystem::path& path, const Character& character, const FigureClip& clip, int morphs,
                    double tolerance = 1e-4) {
  Exported made;
  made.figure = make_figure(character, BoneNames::skeletool);
  made.morphs = fit_morphs(made.figure, character.skeleton, clip, morphs);
  made.tracks = thin_tracks(made.figure, character.skeleton, clip, made.morphs, tolerance);
  made.error = figure_error(made.figure, clip, made.morphs, made.tracks);
  write_glb(path, {character.name, character.mesh, clip}, made.figure, made.morphs, made.tracks);
  return made;
}

/// Distance of the file's vertices from those of the clip, mm, by the specification's equations.
FigureError error_of_file(const GltfPose& file, const FigureClip& clip) {
  const auto index = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  FigureError error;
  for (std::size_t t = 0; t < clip.vertices.size(); ++t) {
    const auto found = file.vertices(static_cast<double>(t) / clip.frames_per_second);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const float* ground_truth = &clip.vertices[t][3 * static_cast<std::size_t>(index[i][0])];
      const double off =
          1000.0 * (found[i] - Eigen::Vector3d(ground_truth[0], ground_truth[1], ground_truth[2])).norm();
      error.worst = std::max(error.worst, off);
      error.mean += off / static_cast<double>(found.size() * clip.vertices.size());
    }
  }
  return error;
}

TEST(WriteGlb, TheFileMovesAsTheClipByTheEquationsOfTheSpecification) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const FigureClip clip = waving_clip(actor, 40, 0.03);
  const Exported made = export_glb(folder / "a.glb", actor, clip, 8);
  const GltfPose file(folder / "a.glb");
  const FigureError error = error_of_file(file, clip);
  EXPECT_LT(error.mean, 2.0);
  EXPECT_LT(error.worst, 8.0);
  EXPECT_NEAR(error.worst, made.error.worst, 0.05);
  // Without targets the wave is missing: the targets hold it.
  export_glb(folder / "b.glb", actor, clip, 0);
  EXPECT_GT(error_of_file(GltfPose(folder / "b.glb"), clip).mean, 10.0);
  for (Eigen::Index t = 0; t < made.morphs.weights.rows(); ++t)
    EXPECT_LE((made.morphs.weights.row(t).array() != 0.0).count(), 8);
  EXPECT_GE(made.morphs.weights.minCoeff(), 0.0);  // Blender clamps weights below 0
  EXPECT_LE(made.morphs.weights.maxCoeff(), 1.0 + 1e-12);
}

TEST(WriteGlb, MorphTargetsHaveNames) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const Exported made = export_glb(folder / "a.glb", actor, waving_clip(actor, 60, 0.06), 8);
  const auto mesh = GltfPose(folder / "a.glb").json["meshes"][0];
  const auto names = mesh["extras"]["targetNames"].get<std::vector<std::string>>();
  EXPECT_EQ(names.size(), mesh["primitives"][0]["targets"].size());
  EXPECT_EQ(names, made.morphs.names);
  EXPECT_EQ(names[0], "Frames1_Way1");
  EXPECT_EQ(std::count(names.begin(), names.end(), "Frames2_Base"), 1);
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  // A target with Base in its name is what the frames of its group start from: its weight is 0 or 1.
  for (std::size_t k = 0; k < names.size(); ++k)
    if (names[k].ends_with("_Base"))
      for (Eigen::Index t = 0; t < made.morphs.weights.rows(); ++t) {
        const double weight = made.morphs.weights(t, static_cast<Eigen::Index>(k));
        EXPECT_TRUE(weight == 0.0 || weight == 1.0) << names[k] << " " << weight;
      }
  export_glb(folder / "b.glb", actor, waving_clip(actor, 5, 0.0), 0);
  EXPECT_FALSE(GltfPose(folder / "b.glb").json["meshes"][0].contains("extras"));
}

TEST(WriteGlb, PartsOfAClipAreAnimationsThatShareTheSkin) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  FigureClip clip = waving_clip(actor, 40, 0.03);
  clip.parts = {{"walk", 0, 26, 25.0}, {"run", 26, 13, 50.0}, {"stand", 39, 1, 25.0}};
  const Exported made = export_glb(folder / "a.glb", actor, clip, 8);
  const GltfPose file(folder / "a.glb");
  ASSERT_EQ(file.json["animations"].size(), 3U);
  EXPECT_EQ(file.json["skins"].size(), 1U);
  EXPECT_EQ(file.json["meshes"].size(), 1U);
  const auto index = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  for (std::size_t a = 0; a < clip.parts.size(); ++a) {
    const ClipPart& part = clip.parts[a];
    EXPECT_EQ(file.json["animations"][a]["name"], part.name);
    double end = 0.0;
    for (const auto& sampler : file.json["animations"][a]["samplers"]) {
      const auto times = file.rows(sampler["input"].get<int>());
      EXPECT_EQ(times.front()[0], 0.0);
      end = std::max(end, times.back()[0]);
    }
    EXPECT_NEAR(end, (part.frames - 1) / part.frames_per_second, 1e-6);
    for (int t = 0; t < part.frames; ++t) {
      const auto found = file.vertices(t / part.frames_per_second, a);
      const std::vector<float>& wanted = clip.vertices[static_cast<std::size_t>(part.first + t)];
      double worst = 0.0;
      for (std::size_t i = 0; i < found.size(); ++i) {
        const float* at = &wanted[3 * static_cast<std::size_t>(index[i][0])];
        worst = std::max(worst, 1000.0 * (found[i] - Eigen::Vector3d(at[0], at[1], at[2])).norm());
      }
      EXPECT_LT(worst, made.error.worst + 0.05) << part.name << " " << t;
    }
  }
  EXPECT_LT(made.error.worst, 8.0);
}

FigureClip repeated(const FigureClip& clip, int times) {
  FigureClip result = clip;
  for (int i = 1; i < times; ++i) {
    result.dofs.insert(result.dofs.end(), clip.dofs.begin(), clip.dofs.end());
    result.vertices.insert(result.vertices.end(), clip.vertices.begin(), clip.vertices.end());
  }
  return result;
}

/// A character at rest whose surface moves in `modes` independent ways, each by some centimetres, at random from frame
/// to frame.
FigureClip random_clip(const Character& character, int frames, int modes) {
  test_character::Noise noise(5);
  const auto values = static_cast<Eigen::Index>(3 * character.mesh.vertices.size());
  Eigen::MatrixXf ways(values, modes);
  for (Eigen::Index k = 0; k < modes; ++k)
    for (Eigen::Index i = 0; i < values; ++i) ways(i, k) = 0.03F * static_cast<float>(noise.next());
  FigureClip clip;
  clip.dofs.assign(static_cast<std::size_t>(frames), character.rest_dofs);
  std::vector<float> still;
  for (const Eigen::Vector3d& v : character.mesh.vertices)
    for (int i = 0; i < 3; ++i) still.push_back(static_cast<float>(v[i]));
  clip.vertices.assign(static_cast<std::size_t>(frames), still);
  for (std::vector<float>& vertices : clip.vertices)
    for (Eigen::Index k = 0; k < modes; ++k)
      Eigen::Map<Eigen::VectorXf>(vertices.data(), values) += static_cast<float>(noise.next()) * ways.col(k);
  return clip;
}

TEST(MorphTargets, AClipThatIsRepeatedNeedsNoMoreOfThem) {
  const Character& actor = test_actor();
  const Figure figure = make_figure(actor, BoneNames::skeletool);
  const FigureClip clip = waving_clip(actor, 60, 0.06);
  const MorphTargets once = fit_morphs(figure, actor.skeleton, clip, 8);
  EXPECT_GT(once.count(), 8);  // one group does not suffice
  const FigureClip often = repeated(clip, 12);
  const MorphTargets many = fit_morphs(figure, actor.skeleton, often, 8);
  EXPECT_LE(many.count(), once.count() + 8);
  EXPECT_FALSE(many.exhausted);
  const FigureTracks tracks = thin_tracks(figure, actor.skeleton, often, many, 0.0);
  EXPECT_LT(figure_error(figure, often, many, tracks).worst, 5.5);
}

TEST(MorphTargets, MoreMoveAtOnceWhereTheMostDoNotSuffice) {
  const Character& actor = test_actor();
  const Figure figure = make_figure(actor, BoneNames::skeletool);
  const FigureClip clip = random_clip(actor, 400, 40);
  const auto worst = [&](const MorphTargets& morphs) {
    return figure_error(figure, clip, morphs, thin_tracks(figure, actor.skeleton, clip, morphs, 0.0)).worst;
  };
  const MorphTargets eight = fit_morphs(figure, actor.skeleton, clip, 8),
                     free = fit_morphs(figure, actor.skeleton, clip, {});
  EXPECT_TRUE(eight.exhausted);
  EXPECT_LE(eight.at_once, 8);
  EXPECT_LE(eight.count(), 256);
  EXPECT_GT(worst(eight), 20.0);
  EXPECT_FALSE(free.exhausted);
  EXPECT_GT(free.at_once, 8);
  EXPECT_LT(worst(free), 5.5);
  for (const MorphTargets* morphs : {&eight, &free})
    for (Eigen::Index t = 0; t < morphs->weights.rows(); ++t)
      ASSERT_LE((morphs->weights.row(t).array() != 0.0).count(), morphs->at_once);
}

TEST(MorphTargets, EightMoveAtOnceWhereTheySuffice) {
  const Character& actor = test_actor();
  const Figure figure = make_figure(actor, BoneNames::skeletool);
  const FigureClip clip = waving_clip(actor, 60, 0.06);
  const MorphTargets free = fit_morphs(figure, actor.skeleton, clip, {}),
                     eight = fit_morphs(figure, actor.skeleton, clip, 8);
  EXPECT_LE(free.at_once, 8);
  EXPECT_EQ(free.at_once, eight.at_once);
  EXPECT_EQ(free.count(), eight.count());
}

TEST(MorphTargets, NoMoreMoveAtOnceThanThereAre) {
  const Character& actor = test_actor();
  const Figure figure = make_figure(actor, BoneNames::skeletool);
  const MorphTargets morphs = fit_morphs(figure, actor.skeleton, random_clip(actor, 20, 2), 8);
  EXPECT_EQ(morphs.count(), 3);  // the mean and two components
  EXPECT_EQ(morphs.at_once, 3);
}

TEST(WriteGlb, OurReaderMovesTheSkinAsWeDo) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const FigureClip clip = waving_clip(actor, 12, 0.0);
  const Exported made = export_glb(folder / "a.glb", actor, clip, 0, 0.0);
  const Scene scene = read_scene(folder / "a.glb");
  ASSERT_EQ(scene.animations.size(), 1U);
  const GltfPose file(folder / "a.glb");
  const auto vertex = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  for (const int t : {0, 5, 11}) {
    const auto found = posed_vertices(scene, node_transforms(scene, scene.animations[0], t / clip.frames_per_second));
    const auto blended =
        blend_transforms(made.figure, pose_nodes(made.figure, actor.skeleton, clip.dofs[static_cast<std::size_t>(t)]));
    ASSERT_EQ(found.size(), vertex.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto v = static_cast<std::size_t>(vertex[i][0]);
      EXPECT_LT((found[i] - blended[v] * actor.mesh.vertices[v]).norm(), 1e-4);
    }
  }
  EXPECT_EQ(import_rig(scene).motions.size(), 1U);
}

TEST(WriteGlb, UvsAreSplitAtSeamsAndCountFromTheTop) {
  const TemporaryFolder folder;
  Character actor = make_test_character();
  actor.mesh.texture = cv::Mat(8, 8, CV_8UC3, cv::Scalar(20, 60, 200));
  export_glb(folder / "a.glb", actor, waving_clip(actor, 2, 0.0), 0);
  const Scene scene = read_scene(folder / "a.glb");
  ASSERT_EQ(scene.primitives.size(), 1U);
  EXPECT_GT(scene.primitives[0].num_vertices(), actor.num_vertices());
  ASSERT_EQ(scene.materials.size(), 1U);
  EXPECT_EQ(scene.materials[0].texture.at<cv::Vec3b>(3, 3), cv::Vec3b(20, 60, 200));
  const ScenePrimitive& part = scene.primitives[0];
  for (std::size_t f = 0; f < 20; ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const auto uv = part.face_uvs.empty() ? part.faces[f][c] : part.face_uvs[f][c];
      EXPECT_LT(
          (part.uvs[static_cast<std::size_t>(uv)] - actor.mesh.uvs[static_cast<std::size_t>(actor.mesh.face_uvs[f][c])])
              .norm(),
          1e-6);
    }
}

TEST(WriteGlb, NamesThatDoNotFitAreRefused) {
  EXPECT_THAT(support::message_of([] { make_figure(test_actor(), BoneNames::mixamo); }),
              ::testing::HasSubstr("could be paired by their names"));
}

TEST(Figure, WeightsAreFourAndSumToOne) {
  const Figure figure = make_figure(test_actor(), BoneNames::skeletool);
  for (const auto& weight : figure.weight) EXPECT_FLOAT_EQ(weight[0] + weight[1] + weight[2] + weight[3], 1.0F);
  EXPECT_EQ(figure.largest_dropped_weight, 0.0);  // this actor has at most four bones per vertex
  const auto blended = blend_transforms(figure, figure.rest);
  for (const Eigen::Affine3d& still : blended) EXPECT_TRUE(still.matrix().isIdentity(1e-6));
}

class RealFigure : public support::SharedFolderTest {};

TEST_F(RealFigure, AScannedPersonKeepsHisSurface) {
  const TemporaryFolder folder;
  const Character person = load_character(character_file());
  const Motion motion =
      read_motion(capture_folder() / "testing/skeletoolToGTPose/poseAngles.motion", person.num_dofs());
  FigureClip clip;
  for (const std::vector<double>& dofs : motion.frames) {
    clip.dofs.push_back(dofs);
    clip.vertices.emplace_back();
    for (const Eigen::Vector3d& v : posed_vertices(person, dofs))
      for (int i = 0; i < 3; ++i) clip.vertices.back().push_back(static_cast<float>(v[i]));
  }
  export_glb(folder / "a.glb", person, clip, 8);
  const GltfPose file(folder / "a.glb");
  const FigureError error = error_of_file(file, clip);
  EXPECT_LT(error.mean, 2.0);
  EXPECT_LT(error.worst, 8.0);
  const Figure named = make_figure(person, BoneNames::mixamo);
  std::map<std::string, int> names;
  for (const FigureNode& node : named.nodes) ++names[node.name];
  for (const char* name : {"mixamorig:Hips", "mixamorig:Spine", "mixamorig:LeftForeArm", "mixamorig:RightUpLeg"})
    EXPECT_EQ(names[name], 1) << name;
}

TEST(WriteGlb, ColoursOfVerticesComeBack) {
  const TemporaryFolder folder;
  Character actor = make_test_character();
  actor.mesh.texture.release();
  for (int v = 0; v < actor.num_vertices(); ++v) actor.mesh.colours.emplace_back(0.2, 0.5, v % 2 == 0 ? 0.0 : 1.0);
  export_glb(folder / "a.glb", actor, waving_clip(actor, 2, 0.0), 0);
  // The format has linear intensities: 0.5 in sRGB is 0.2140.
  const GltfPose file(folder / "a.glb");
  const auto stored = file.rows(file.primitive()["attributes"]["COLOR_0"].get<int>());
  EXPECT_NEAR(stored.at(0)[1], 0.2140, 1e-4);
  const ScenePrimitive part = read_scene(folder / "a.glb").primitives.at(0);
  const auto vertex = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  for (std::size_t i = 0; i < part.colours.size(); ++i)
    EXPECT_LT((part.colours[i] - actor.mesh.colours[static_cast<std::size_t>(vertex.at(i)[0])]).norm(), 1e-5);
}

}  // namespace
}  // namespace doppel::write_glb_test
