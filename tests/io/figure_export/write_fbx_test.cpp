#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>

#include <assimp/Importer.hpp>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/io/figure_export/write_figure.h"
#include "doppel/io/scene/fbx_file.h"
#include "doppel/io/scene/read_scene.h"
#include "io/figure_export/waving_clip.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::write_fbx_test {
namespace {

using support::TemporaryFolder;
using support::waving_clip;

/// Of a file, in its own centimetres, to metres.
constexpr double kMetresPerUnit = 0.01;

struct Exported {
  Figure figure;
  MorphTargets morphs;
  FigureTracks tracks;
  std::vector<EulerTrack> turns;
  FigureError error;
};

Exported export_fbx(const std::filesystem::path& path, const Character& character, const FigureClip& clip, int morphs,
                    double tolerance = 1e-4) {
  Exported made;
  made.figure = make_figure(character, BoneNames::skeletool);
  made.morphs = fit_morphs(made.figure, character.skeleton, clip, morphs);
  made.tracks = thin_tracks(made.figure, character.skeleton, clip, made.morphs, tolerance);
  made.turns = euler_tracks(made.figure, made.tracks, tolerance);
  made.error = figure_error(made.figure, clip, made.morphs, with_euler_rotations(made.figure, made.tracks, made.turns));
  write_fbx(path, {character.name, character.mesh, clip}, made.figure, made.morphs, made.tracks, made.turns);
  return made;
}

Character textured_actor() {
  Character actor = make_test_character();
  actor.mesh.texture = cv::Mat(8, 8, CV_8UC3, cv::Scalar(20, 60, 200));
  actor.mesh.texture.at<cv::Vec3b>(1, 2) = {250, 10, 5};
  return actor;
}

/// The vertices of a file over time: our reader for skin and bones, and the records of the blend shapes, which it
/// leaves out.
class FbxPose {
 public:
  explicit FbxPose(const std::filesystem::path& path)
      : scene(read_scene(path)), root_(read_fbx_records(path, {})), objects_(root_) {
    for (const FbxRecord* deformer : objects_.all("Deformer"))
      if (deformer->text(2) == "BlendShapeChannel") add_shape(*deformer);
  }

  Scene scene;

  /// [N] world metres
  std::vector<Eigen::Vector3d> vertices(double seconds) const {
    ScenePrimitive surface = scene.primitives.at(0);
    for (const Shape& shape : shapes_) {
      const double weight = 0.01 * weight_at(shape, seconds);
      for (std::size_t i = 0; i < shape.indices.size(); ++i)
        surface.vertices[static_cast<std::size_t>(shape.indices[i])] += weight * Eigen::Vector3d(&shape.offsets[3 * i]);
    }
    auto found = posed_vertices(scene, surface, node_transforms(scene, scene.animations.at(0), seconds));
    for (Eigen::Vector3d& vertex : found) vertex *= kMetresPerUnit;
    return found;
  }
  std::size_t num_shapes() const { return shapes_.size(); }

 private:
  struct Shape {
    std::vector<std::int64_t> indices, times;
    std::vector<double> offsets, percent;
  };
  void add_shape(const FbxRecord& channel) {
    const FbxRecord* geometry = objects_.below(channel, "Geometry").at(0);
    const FbxRecord* node = objects_.below(channel, "AnimationCurveNode", "DeformPercent").at(0);
    const FbxRecord* curve = objects_.below(*node, "AnimationCurve", "d|DeformPercent").at(0);
    shapes_.push_back({geometry->child("Indexes")->integers(), curve->child("KeyTime")->integers(),
                       geometry->child("Vertices")->numbers(), curve->child("KeyValueFloat")->numbers()});
  }
  static double weight_at(const Shape& shape, double seconds) {
    const double ticks = seconds * 46186158000.0;
    std::size_t next = 0;
    while (next < shape.times.size() && static_cast<double>(shape.times[next]) < ticks) ++next;
    if (next == 0) return shape.percent.front();
    if (next == shape.times.size()) return shape.percent.back();
    const auto from = static_cast<double>(shape.times[next - 1]), to = static_cast<double>(shape.times[next]);
    const double share = (ticks - from) / (to - from);
    return (1 - share) * shape.percent[next - 1] + share * shape.percent[next];
  }

  FbxRecord root_;
  FbxObjects objects_;
  std::vector<Shape> shapes_;
};

FigureError error_of_file(const FbxPose& file, const FigureClip& clip) {
  FigureError error;
  for (std::size_t t = 0; t < clip.vertices.size(); ++t) {
    const auto found = file.vertices(static_cast<double>(t) / clip.frames_per_second);
    for (std::size_t v = 0; v < found.size(); ++v) {
      const double off =
          1000.0 * (found[v] - Eigen::Map<const Eigen::Vector3f>(&clip.vertices[t][3 * v]).cast<double>()).norm();
      error.worst = std::max(error.worst, off);
      error.mean += off / static_cast<double>(found.size() * clip.vertices.size());
    }
  }
  return error;
}

TEST(WriteFbx, TheFileMovesAsTheClip) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const FigureClip clip = waving_clip(actor, 40, 0.03);
  const Exported made = export_fbx(folder / "a.fbx", actor, clip, 8);
  const FbxPose file(folder / "a.fbx");
  EXPECT_EQ(file.num_shapes(), made.morphs.targets.size());
  const FigureError error = error_of_file(file, clip);
  EXPECT_LT(error.mean, 2.0);
  EXPECT_LT(error.worst, 8.0);
  EXPECT_NEAR(error.worst, made.error.worst, 0.02);
  EXPECT_NEAR(error.mean, made.error.mean, 0.02);
  // The angles cost no more than the tolerance of each joint of the chain.
  EXPECT_NEAR(made.error.worst, figure_error(made.figure, clip, made.morphs, made.tracks).worst, 0.3);
}

TEST(WriteFbx, OurReaderReadsBackWhatWasWritten) {
  const TemporaryFolder folder;
  const Character actor = textured_actor();
  const FigureClip clip = waving_clip(actor, 12, 0.0);
  const Exported made = export_fbx(folder / "a.fbx", actor, clip, 0, 0.0);
  const Scene scene = read_scene(folder / "a.fbx");
  EXPECT_THAT(scene.warnings, ::testing::IsEmpty());
  EXPECT_EQ(scene.metres_per_unit, kMetresPerUnit);
  EXPECT_EQ(scene.up, 'y');
  ASSERT_EQ(scene.primitives.size(), 1U);
  const ScenePrimitive& surface = scene.primitives[0];
  EXPECT_EQ(surface.faces, actor.mesh.faces);
  EXPECT_EQ(surface.face_uvs, actor.mesh.face_uvs);
  EXPECT_EQ(surface.uvs, actor.mesh.uvs);
  for (std::size_t v = 0; v < surface.vertices.size(); ++v)
    EXPECT_LT((kMetresPerUnit * surface.vertices[v] - actor.mesh.vertices[v]).norm(), 1e-6);
  ASSERT_EQ(scene.materials.size(), 1U);
  EXPECT_EQ(cv::norm(scene.materials[0].texture, actor.mesh.texture, cv::NORM_INF), 0.0);
  ASSERT_EQ(scene.animations.size(), 1U);
  EXPECT_EQ(scene.animations[0].name, actor.name);
  EXPECT_EQ(scene.animations[0].start, 0.0);
  EXPECT_NEAR(scene.animations[0].end, 11 / clip.frames_per_second, 1e-9);
  for (int t = 0; t < clip.num_frames(); ++t) {
    const auto world = node_transforms(scene, scene.animations[0], t / clip.frames_per_second);
    const auto wanted = pose_nodes(made.figure, actor.skeleton, clip.dofs[static_cast<std::size_t>(t)]);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      Eigen::Affine3d found = world[i + 1];  // node 0 is the surface
      found.translation() *= kMetresPerUnit;
      EXPECT_TRUE(found.isApprox(wanted[i], 1e-5)) << t << " " << made.figure.nodes[i].name;
    }
  }
}

TEST(WriteFbx, BonesAndWeightsAreThoseOfTheFigure) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const Exported made = export_fbx(folder / "a.fbx", actor, waving_clip(actor, 3, 0.0), 0);
  const Scene scene = read_scene(folder / "a.fbx");
  ASSERT_EQ(scene.nodes.size(), made.figure.nodes.size() + 1);
  const auto world = node_transforms(scene);
  for (std::size_t i = 0; i < made.figure.nodes.size(); ++i) {
    EXPECT_EQ(scene.nodes[i + 1].name, made.figure.nodes[i].name);
    const int parent = made.figure.nodes[i].parent;
    EXPECT_EQ(scene.nodes[i + 1].parent, parent < 0 ? -1 : parent + 1);
    Eigen::Affine3d rest = world[i + 1];
    rest.translation() *= kMetresPerUnit;
    EXPECT_TRUE(rest.isApprox(made.figure.rest[i], 1e-9));
  }
  const ScenePrimitive& surface = scene.primitives.at(0);
  const SceneSkin& skin = scene.skins.at(0);
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    Eigen::Affine3d joint_from_mesh = skin.joint_from_mesh[j];
    joint_from_mesh.translation() *= kMetresPerUnit;
    const auto bone = static_cast<std::size_t>(skin.joints[j] - 1);
    EXPECT_TRUE(joint_from_mesh.isApprox(made.figure.rest[bone].inverse(), 1e-9));
  }
  for (std::size_t v = 0; v < made.figure.node.size(); ++v) {
    std::map<int, double> found;
    const auto first = static_cast<std::size_t>(surface.vertex_joints.offsets[v]);
    for (std::size_t i = first; i < static_cast<std::size_t>(surface.vertex_joints.offsets[v + 1]); ++i)
      found[skin.joints[static_cast<std::size_t>(surface.vertex_joints.items[i])] - 1] = surface.weights[i];
    for (std::size_t i = 0; i < 4; ++i)
      if (made.figure.weight[v][i] > 0) {
        EXPECT_NEAR(found[made.figure.node[v][i]], made.figure.weight[v][i], 1e-6);
      }
  }
}

TEST(WriteFbx, AssimpReadsTheSame) {
  const TemporaryFolder folder;
  const Character actor = textured_actor();
  const FigureClip clip = waving_clip(actor, 20, 0.03);
  const Exported made = export_fbx(folder / "a.fbx", actor, clip, 4);
  Assimp::Importer importer;  // a reader that shares nothing with ours
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
  const aiScene* scene = importer.ReadFile((folder / "a.fbx").string(), aiProcess_ValidateDataStructure);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  for (const FigureNode& node : made.figure.nodes) {
    const aiNode* found = scene->mRootNode->FindNode(node.name.c_str());
    ASSERT_NE(found, nullptr) << node.name;
    if (node.parent >= 0) {
      EXPECT_EQ(found->mParent->mName.C_Str(), made.figure.nodes[static_cast<std::size_t>(node.parent)].name);
    }
  }
  ASSERT_EQ(scene->mNumMeshes, 1U);
  const aiMesh& mesh = *scene->mMeshes[0];
  EXPECT_EQ(mesh.mNumFaces, actor.mesh.faces.size());
  EXPECT_TRUE(mesh.HasNormals());
  EXPECT_TRUE(mesh.HasTextureCoords(0));
  EXPECT_EQ(mesh.mNumAnimMeshes, made.morphs.targets.size());
  std::set<int> weighted;
  for (std::size_t v = 0; v < made.figure.node.size(); ++v)
    for (std::size_t i = 0; i < 4; ++i)
      if (made.figure.weight[v][i] > 0) weighted.insert(made.figure.node[v][i]);
  EXPECT_EQ(mesh.mNumBones, weighted.size());
  ASSERT_EQ(scene->mNumAnimations, 1U);
  EXPECT_EQ(scene->mAnimations[0]->mNumChannels, made.figure.nodes.size());
  ASSERT_EQ(scene->mNumTextures, 1U);  // inside of the file
  const aiTexture& texture = *scene->mTextures[0];
  const std::vector<unsigned char> png(reinterpret_cast<const unsigned char*>(texture.pcData),
                                       reinterpret_cast<const unsigned char*>(texture.pcData) + texture.mWidth);
  EXPECT_EQ(cv::norm(cv::imdecode(png, cv::IMREAD_COLOR), actor.mesh.texture, cv::NORM_INF), 0.0);
}

TEST(WriteFbx, IdsAreUniqueAndConnectionsLeadToObjects) {
  const TemporaryFolder folder;
  const Character actor = textured_actor();
  const Exported made = export_fbx(folder / "a.fbx", actor, waving_clip(actor, 20, 0.03), 4);
  const FbxRecord root = read_fbx_records(folder / "a.fbx", {});
  std::map<std::int64_t, const FbxRecord*> by_id;
  std::map<std::string, std::int64_t> counts;
  for (const FbxRecord& object : root.child("Objects")->children) {
    EXPECT_GT(object.integer(0), 0);
    EXPECT_TRUE(by_id.emplace(object.integer(0), &object).second) << object.integer(0);
    ++counts[object.name];
  }
  std::set<std::int64_t> connected;
  for (const FbxRecord& connection : root.child("Connections")->children) {
    const std::int64_t lower = connection.integer(1), upper = connection.integer(2);
    EXPECT_TRUE(by_id.count(lower)) << lower;
    EXPECT_TRUE(upper == 0 || by_id.count(upper)) << upper;
    EXPECT_EQ(connection.text(0), connection.values.size() == 4 ? "OP" : "OO");
    connected.insert(lower);
  }
  for (const auto& [id, object] : by_id)
    EXPECT_TRUE(connected.count(id) || object->name == "Pose" || object->name == "AnimationStack") << object->text(1);
  EXPECT_EQ(counts["Model"], static_cast<std::int64_t>(made.figure.nodes.size()) + 1);
  std::int64_t sum = 0;
  for (const FbxRecord& type : root.child("Definitions")->children)
    if (type.name == "ObjectType") {
      const std::int64_t count = type.child("Count")->integer(0);
      sum += count;
      if (type.text(0) != "GlobalSettings") {
        EXPECT_EQ(count, counts[type.text(0)]) << type.text(0);
      }
    }
  EXPECT_EQ(sum, root.child("Definitions")->child("Count")->integer(0));
  EXPECT_EQ(sum, static_cast<std::int64_t>(by_id.size()) + 1);
  for (const FbxRecord* pose : FbxObjects(root).all("Pose"))
    for (const FbxRecord& node : pose->children)
      if (node.name == "PoseNode") {
        EXPECT_EQ(by_id.at(node.child("Node")->integer(0))->name, "Model");
      }
}

TEST(WriteFbx, CurvesHaveAValueForEachTimeInAscendingOrder) {
  const TemporaryFolder folder;
  const Exported made = export_fbx(folder / "a.fbx", test_actor(), waving_clip(test_actor(), 40, 0.03), 4);
  const FbxRecord root = read_fbx_records(folder / "a.fbx", {});
  const FbxObjects objects(root);
  const auto curves = objects.all("AnimationCurve");
  EXPECT_EQ(curves.size(), 6 * made.figure.nodes.size() + made.morphs.targets.size());
  for (const FbxRecord* curve : curves) {
    const auto times = curve->child("KeyTime")->integers();
    ASSERT_EQ(times.size(), curve->child("KeyValueFloat")->numbers().size());
    EXPECT_EQ(curve->child("KeyAttrRefCount")->integers(),
              std::vector<std::int64_t>{static_cast<std::int64_t>(times.size())});
    for (std::size_t k = 1; k < times.size(); ++k) EXPECT_LT(times[k - 1], times[k]);
  }
}

TEST(WriteFbx, TheSameFigureGivesTheSameBytes) {
  const TemporaryFolder folder;
  const Character actor = textured_actor();
  const FigureClip clip = waving_clip(actor, 5, 0.02);
  export_fbx(folder / "a.fbx", actor, clip, 2);
  const std::string first = read_file(folder / "a.fbx");
  export_fbx(folder / "a.fbx", actor, clip, 2);
  EXPECT_EQ(first, read_file(folder / "a.fbx"));
  // The last bytes of the format: the version again, 120 zeros and a fixed end; the footer ends a block of 16 bytes.
  EXPECT_EQ(first.substr(first.size() - 140, 4), std::string("\xe8\x1c\0\0", 4));
  EXPECT_EQ((first.size() - 144) % 16, 0U);
}

TEST(WriteFbx, RatesOfTheFormatHaveItsNumbers) {
  const TemporaryFolder folder;
  const std::map<double, int> modes{{24, 11}, {25, 10}, {30, 6}, {50, 4}, {60, 3}, {29.97, 9}, {17.5, 14}};
  for (const auto& [rate, mode] : modes) {
    FigureClip clip = waving_clip(test_actor(), 8, 0.0);
    clip.frames_per_second = rate;
    export_fbx(folder / "a.fbx", test_actor(), clip, 0);
    const FbxRecord root = read_fbx_records(folder / "a.fbx", {});
    const FbxRecord& settings = *root.child("GlobalSettings");
    EXPECT_EQ(fbx_number(settings, "TimeMode", -1), mode);
    EXPECT_EQ(fbx_number(settings, "CustomFrameRate", 0), mode == 14 ? rate : -1);
    EXPECT_NEAR(fbx_number(settings, "TimeSpanStop", 0), 7 / rate * 46186158000.0, 1.0);
    EXPECT_NEAR(read_scene(folder / "a.fbx").animations.at(0).end, 7 / rate, 1e-9);
  }
}

TEST(WriteFbx, AFigureWithoutFramesStandsStill) {
  const TemporaryFolder folder;
  const Character& actor = test_actor();
  const FigureClip none;
  const Figure figure = make_figure(actor, BoneNames::skeletool);
  write_fbx(folder / "a.fbx", {actor.name, actor.mesh, none}, figure, {}, {}, {});
  const Scene scene = read_scene(folder / "a.fbx");
  EXPECT_TRUE(scene.animations.empty());
  EXPECT_EQ(scene.num_faces(), actor.mesh.num_faces());
}

class RealFbx : public support::SharedFolderTest {};

TEST_F(RealFbx, AScannedPersonMovesAsTheClip) {
  const TemporaryFolder folder;
  const Character person = load_character(character_file());
  const Motion motion =
      read_motion(capture_folder() / "testing/skeletoolToGTPose/poseAngles.motion", person.num_dofs());
  FigureClip clip;
  for (std::size_t t = 0; t < motion.frames.size(); t += 3) {
    clip.dofs.push_back(motion.frames[t]);
    clip.vertices.emplace_back();
    for (const Eigen::Vector3d& v : posed_vertices(person, motion.frames[t]))
      for (int i = 0; i < 3; ++i) clip.vertices.back().push_back(static_cast<float>(v[i]));
  }
  const Exported made = export_fbx(folder / "a.fbx", person, clip, 8);
  const FigureError error = error_of_file(FbxPose(folder / "a.fbx"), clip);
  EXPECT_LT(error.worst, 8.0);
  EXPECT_NEAR(error.worst, made.error.worst, 0.05);
}

}  // namespace
}  // namespace doppel::write_fbx_test
