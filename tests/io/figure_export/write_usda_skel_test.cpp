#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "doppel/core/atomic_file.h"
#include "doppel/io/figure_export/write_figure.h"
#include "io/figure_export/waving_clip.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::write_usda_skel_test {
namespace {

using support::TemporaryFolder;

/// All numbers of a text.
std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> values;
  for (const char* at = text.c_str(); *at != '\0';) {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (end != at) values.push_back(value);
    at = end != at ? end : at + 1;
  }
  return values;
}

/// A figure as a reader of UsdSkel sees it.
class SkelFile {
 public:
  explicit SkelFile(const std::filesystem::path& path) : text_(read_file(path)) {
    const std::string joints = list("uniform token[] joints = ");
    std::vector<std::string> paths;
    for (std::size_t at = joints.find('"'); at != std::string::npos;) {
      const std::size_t end = joints.find('"', at + 1);
      paths.push_back(joints.substr(at + 1, end - at - 1));
      at = joints.find('"', end + 1);
    }
    for (const std::string& joint : paths) {
      const std::size_t slash = joint.rfind('/');
      const auto parent =
          slash == std::string::npos ? paths.end() : std::find(paths.begin(), paths.end(), joint.substr(0, slash));
      parents_.push_back(parent == paths.end() ? -1 : static_cast<int>(parent - paths.begin()));
    }
    for (std::size_t at = text_.find("def BlendShape"); at != std::string::npos;
         at = text_.find("def BlendShape", at + 1))
      offsets_.push_back(numbers_in(list("offsets = ", at)));
  }

  const std::string& text() const { return text_; }
  const std::vector<int>& parents() const { return parents_; }

  /// The list that follows `key`, with its brackets.
  std::string list(const std::string& key, std::size_t from = 0) const {
    const std::size_t at = text_.find(key, from);
    if (at == std::string::npos) throw std::runtime_error("the file has no " + key);
    const std::size_t begin = text_.find('[', at + key.size() - 1);
    return text_.substr(begin, text_.find(']', begin) - begin + 1);
  }
  /// The sample of a frame.
  std::vector<double> sample(const std::string& attribute, int frame) const {
    const std::size_t at = text_.find(attribute + ".timeSamples");
    return numbers_in(list(" " + std::to_string(frame) + ": ", at));
  }
  std::vector<Eigen::Affine3d> matrices(const std::string& attribute) const {
    const std::vector<double> values = numbers_in(list("matrix4d[] " + attribute + " = "));
    std::vector<Eigen::Affine3d> result;
    for (std::size_t i = 0; i + 16 <= values.size(); i += 16)
      result.emplace_back(Eigen::Map<const Eigen::Matrix4d>(&values[i]));  // rows in the file, columns in Eigen
    return result;
  }
  /// Transforms of the joints to the skeleton, given those to their parents.
  std::vector<Eigen::Affine3d> chained(std::vector<Eigen::Affine3d> transforms) const {
    for (std::size_t j = 0; j < transforms.size(); ++j)
      if (parents_[j] >= 0) transforms[j] = transforms[parents_[j]] * transforms[j];
    return transforms;
  }

  /// The equations of UsdSkel: blend shapes are added to the points, then sum_i w_i (bind^-1 joint) moves them.
  std::vector<Eigen::Vector3d> vertices(int frame) const {
    const auto shift = sample("translations", frame), turn = sample("rotations", frame);
    std::vector<Eigen::Affine3d> joints;
    for (std::size_t j = 0; j < parents_.size(); ++j)
      joints.push_back(Eigen::Translation3d(shift[3 * j], shift[3 * j + 1], shift[3 * j + 2]) *
                       Eigen::Quaterniond(turn[4 * j], turn[4 * j + 1], turn[4 * j + 2], turn[4 * j + 3]));
    joints = chained(joints);
    const auto bind = matrices("bindTransforms");
    for (std::size_t j = 0; j < joints.size(); ++j) joints[j] = joints[j] * bind[j].inverse();
    std::vector<double> points = numbers_in(list("point3f[] points = "));
    const auto shapes = offsets_.empty() ? std::vector<double>() : sample("blendShapeWeights", frame);
    for (std::size_t k = 0; k < shapes.size(); ++k)
      for (std::size_t i = 0; i < points.size(); ++i) points[i] += shapes[k] * offsets_[k][i];
    const auto index = numbers_in(list("skel:jointIndices = ")), weight = numbers_in(list("skel:jointWeights = "));
    std::vector<Eigen::Vector3d> moved(points.size() / 3, Eigen::Vector3d::Zero());
    for (std::size_t v = 0; v < moved.size(); ++v)
      for (std::size_t i = 4 * v; i < 4 * v + 4; ++i)
        moved[v] += weight[i] * (joints[static_cast<std::size_t>(index[i])] *
                                 Eigen::Vector3d(points[3 * v], points[3 * v + 1], points[3 * v + 2]));
    return moved;
  }

 private:
  std::string text_;
  std::vector<int> parents_;
  std::vector<std::vector<double>> offsets_;
};

class WriteUsdaSkel : public testing::Test {
 protected:
  WriteUsdaSkel() : clip_(support::waving_clip(actor_, 12, 0.03)) {}

  SkelFile written(int count) {
    const MorphTargets morphs = fit_morphs(figure_, actor_.skeleton, clip_, count);
    const FigureTracks tracks = thin_tracks(figure_, actor_.skeleton, clip_, morphs, 1e-4);
    error_ = figure_error(figure_, clip_, morphs, tracks);
    write_usda_skel(folder_ / "a.usda", {actor_.name, actor_.mesh, clip_}, figure_, morphs, tracks, "skin.png");
    return SkelFile(folder_ / "a.usda");
  }
  FigureError error_of(const SkelFile& file) const {
    FigureError error;
    for (int t = 0; t < clip_.num_frames(); ++t) {
      const auto found = file.vertices(t);
      EXPECT_EQ(found.size(), actor_.mesh.vertices.size());
      for (std::size_t v = 0; v < found.size(); ++v) {
        const float* ground_truth = &clip_.vertices[t][3 * v];
        const double off =
            1000.0 * (found[v] - Eigen::Vector3d(ground_truth[0], ground_truth[1], ground_truth[2])).norm();
        error.worst = std::max(error.worst, off);
        error.mean += off / static_cast<double>(found.size() * clip_.vertices.size());
      }
    }
    return error;
  }

  const TemporaryFolder folder_;
  const Character& actor_ = test_actor();
  const Figure figure_ = make_figure(actor_, BoneNames::skeletool);
  FigureClip clip_;
  FigureError error_;
};

TEST_F(WriteUsdaSkel, TheFileMovesAsTheClipByTheEquationsOfTheSpecification) {
  const FigureError error = error_of(written(8));
  EXPECT_LT(error.mean, 2.0);
  EXPECT_LT(error.worst, 8.0);
  EXPECT_NEAR(error.mean, error_.mean, 0.01);
  EXPECT_NEAR(error.worst, error_.worst, 0.05);
}

TEST_F(WriteUsdaSkel, WithoutBlendShapesTheSkinAloneMoves) {
  const SkelFile file = written(0);
  EXPECT_EQ(file.text().find("blendShape"), std::string::npos);
  const FigureError error = error_of(file);
  EXPECT_GT(error.worst, 8.0);
  EXPECT_NEAR(error.worst, error_.worst, 0.05);
}

TEST_F(WriteUsdaSkel, RestAndBindTransformsAreThoseOfTheFigure) {
  const SkelFile file = written(2);
  for (std::size_t j = 0; j < figure_.nodes.size(); ++j) EXPECT_EQ(file.parents()[j], figure_.nodes[j].parent);
  const auto bind = file.matrices("bindTransforms"), rest = file.chained(file.matrices("restTransforms"));
  ASSERT_EQ(bind.size(), figure_.rest.size());
  for (std::size_t j = 0; j < bind.size(); ++j) {
    EXPECT_LT((bind[j].matrix() - figure_.rest[j].matrix()).norm(), 1e-6);
    EXPECT_LT((bind[j].matrix() - rest[j].matrix()).norm(), 1e-6);
  }
}

TEST_F(WriteUsdaSkel, BlendShapesHaveTheNamesOfTheTargets) {
  const SkelFile file = written(3);
  const std::string names = file.list("uniform token[] blendShapes = ");
  EXPECT_EQ(names.find(R"(["Frames1_Way1", "Frames1_Way2", "Frames1_Base", "Frames2_Way1")"), 0U) << names;
  EXPECT_EQ(file.list("uniform token[] skel:blendShapes = "), names);
  EXPECT_NE(file.text().find("def BlendShape \"Frames1_Base\""), std::string::npos);
}

TEST_F(WriteUsdaSkel, TheExtentOfAFrameHoldsItsVertices) {
  const SkelFile file = written(8);
  for (int t = 0; t < clip_.num_frames(); ++t) {
    const std::vector<double> box = file.sample("float3[] extent", t);
    ASSERT_EQ(box.size(), 6U);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (std::size_t i = axis; i < clip_.vertices[0].size(); i += 3) {
        low = std::min<double>(low, clip_.vertices[static_cast<std::size_t>(t)][i]);
        high = std::max<double>(high, clip_.vertices[static_cast<std::size_t>(t)][i]);
      }
      EXPECT_NEAR(box[axis], low, 1e-5);
      EXPECT_NEAR(box[3 + axis], high, 1e-5);
    }
  }
}

TEST_F(WriteUsdaSkel, NormalsAreThoseOfTheRestPose) {
  const std::vector<double> normals = numbers_in(written(0).list("normal3f[] normals = "));
  ASSERT_EQ(normals.size(), 3 * actor_.mesh.vertices.size());
  // A corner of a face has a normal on the same side as the face, as the surface is smooth.
  std::size_t same_side = 0;
  for (const Triangle& face : actor_.mesh.faces) {
    const Eigen::Vector3d a = actor_.mesh.vertices[face[0]], b = actor_.mesh.vertices[face[1]],
                          c = actor_.mesh.vertices[face[2]], upright = (b - a).cross(c - a);
    const Eigen::Vector3d normal(normals[3 * face[0]], normals[3 * face[0] + 1], normals[3 * face[0] + 2]);
    EXPECT_NEAR(normal.norm(), 1.0, 1e-3);
    same_side += upright.dot(normal) > 0.0 ? 1 : 0;
  }
  EXPECT_EQ(same_side, actor_.mesh.faces.size());
}

TEST_F(WriteUsdaSkel, ValuesWithoutATimeAreThoseOfTheFirstFrame) {
  const SkelFile file = written(4);
  for (const char* attribute : {"float3[] translations", "quatf[] rotations", "float[] blendShapeWeights"})
    EXPECT_EQ(numbers_in(file.list(std::string(attribute) + " = ")), file.sample(attribute, 0)) << attribute;
}

TEST_F(WriteUsdaSkel, TheTextIsWhole) {
  const std::string text = written(3).text();
  EXPECT_EQ(text.substr(0, 10), "#usda 1.0\n");
  for (const auto& [open, close] : {std::pair{'{', '}'}, {'(', ')'}, {'[', ']'}})
    EXPECT_EQ(std::count(text.begin(), text.end(), open), std::count(text.begin(), text.end(), close)) << open;
  EXPECT_EQ(text.find("nan"), std::string::npos);
  const bool textured = !actor_.mesh.texture.empty();
  EXPECT_EQ(text.find("@./skin.png@") != std::string::npos, textured);
  EXPECT_EQ(std::filesystem::exists(folder_ / "skin.png"), textured);
}

}  // namespace
}  // namespace doppel::write_usda_skel_test
