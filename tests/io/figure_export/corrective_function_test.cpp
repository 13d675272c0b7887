// The inputs and weights of a function of the bones, by hand; and what a .glb says of it.
#include "doppel/io/figure_export/corrective_function.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/io/figure_export/write_figure.h"
#include "io/figure_export/waving_clip.h"
#include "support/gltf_pose.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::corrective_function_test {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Translation3d;
using Eigen::Vector3d;

/// Two bones, the second of which rests turned by a quarter about z, and one lag.
CorrectiveFunction two_bones() {
  CorrectiveFunction function;
  function.parents = {-1, 0};
  function.rest = {Quaterniond::Identity(), Quaterniond(AngleAxisd(M_PI / 2, Vector3d::UnitZ()))};
  function.lags = {0.04};
  return function;
}

std::vector<Affine3d> pose(const Affine3d& root, const Vector3d& axis, double angle) {
  return {root,
          root * Translation3d(0.0, 0.3, 0.0) * AngleAxisd(M_PI / 2, Vector3d::UnitZ()) * AngleAxisd(angle, axis)};
}

TEST(CorrectiveFunction, InputsAreRotationsAndTheWayOfTheBones) {
  const Affine3d now = Translation3d(1.0, 2.0, 3.0) * AngleAxisd(0.7, Vector3d::UnitY()),
                 before = Translation3d(1.0, 1.9, 3.0) * AngleAxisd(0.7, Vector3d::UnitY());
  const Eigen::VectorXf x =
      two_bones().inputs({pose(now, Vector3d::UnitX(), 0.4), pose(before, Vector3d::UnitX(), 0.1)});
  ASSERT_EQ(x.size(), 18);
  // The root: upright, 0.1 m lower before, without a turn.
  const double half = 2.0 * std::sin(0.2), turned = -2.0 * std::sin(0.15);
  const std::vector<double> expected{0, 1, 0, 0, -0.1, 0, 0, 0, 0, half, 0, 0};
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR(x(static_cast<Eigen::Index>(i)), expected[i], 1e-6) << i;
  // Its child: a way of 0.1 m down, along -x after the quarter about z, and that turned by -0.4 about x.
  EXPECT_NEAR(x(12), -0.1, 1e-6);
  EXPECT_NEAR(x(13), 0.0, 1e-6);
  EXPECT_NEAR(x(14), 0.0, 1e-6);
  EXPECT_NEAR(x(15), turned, 1e-6);
  EXPECT_NEAR(x(16), 0.0, 1e-6);
}

TEST(CorrectiveFunction, InputsDoNotKnowWhereTheFigureStandsAndLooks) {
  const Affine3d now = Translation3d(0.1, 0.9, 0.2) * AngleAxisd(0.5, Vector3d(1, 2, 3).normalized()),
                 before = Translation3d(0.0, 1.0, 0.1) * AngleAxisd(0.4, Vector3d(1, 2, 2).normalized());
  const Affine3d elsewhere = Translation3d(5.0, 1.0, -7.0) * AngleAxisd(2.5, Vector3d::UnitY());
  const Vector3d axis = Vector3d(3, -1, 2).normalized();
  const Eigen::VectorXf here = two_bones().inputs({pose(now, axis, 1.1), pose(before, axis, 0.9)}),
                        there =
                            two_bones().inputs({pose(elsewhere * now, axis, 1.1), pose(elsewhere * before, axis, 0.9)});
  EXPECT_LT((here - there).cwiseAbs().maxCoeff(), 1e-5);
}

CorrectiveFunction small_function() {
  CorrectiveFunction function = two_bones();
  const Eigen::Index inputs = function.num_inputs();
  function.mean = Eigen::VectorXf::LinSpaced(inputs, -0.2F, 0.3F);
  function.scale = Eigen::VectorXf::LinSpaced(inputs, 0.5F, 2.0F);
  function.linear = Eigen::MatrixXf::Zero(2, inputs);
  function.linear(0, 3) = 0.1F;
  function.offset = Eigen::Vector2f(0.5F, 0.9F);
  function.hidden = Eigen::MatrixXf::Zero(3, inputs);
  function.hidden(1, 7) = 1.5F;
  function.hidden_offset = Eigen::Vector3f(0.0F, 0.2F, 0.0F);
  function.output = Eigen::MatrixXf::Zero(2, 3);
  function.output(1, 1) = 0.3F;
  return function;
}

TEST(CorrectiveFunction, WeightsAreAffineWithAHiddenLayer) {
  const CorrectiveFunction function = small_function();
  Eigen::VectorXf x = function.mean;
  x(3) += 1.0F;
  x(7) -= 0.5F;
  const Eigen::VectorXf w = function.weights(x);
  EXPECT_NEAR(w(0), 0.5 + 0.1 * static_cast<double>(function.scale(3)), 1e-6);
  EXPECT_NEAR(w(1), 0.9 + 0.3 * std::tanh(0.2 - 1.5 * 0.5 * static_cast<double>(function.scale(7))), 1e-6);
  // Inputs are limited to four deviations, weights to 0 to 1.
  x(3) += 1e6F;
  EXPECT_NEAR(function.weights(x)(0), 0.9, 1e-6);
  x(7) += 10.0F;
  EXPECT_EQ(function.weights(x)(1), 1.0F);
}

TEST(CorrectiveFunction, AGlbHoldsItBesideTheNamesOfTheTargets) {
  const support::TemporaryFolder folder;
  const Character character = make_test_character();
  const FigureClip clip = support::waving_clip(character, 4, 0.01);
  const Figure figure = make_figure(character, BoneNames::skeletool);
  const MorphTargets morphs = fit_morphs(figure, character.skeleton, clip, 3);
  const FigureTracks tracks = thin_tracks(figure, character.skeleton, clip, morphs, 1e-4);
  const CorrectiveFunction function = small_function();
  FigureFile file{"anna", character.mesh, clip};
  file.correctives = &function;
  write_glb(folder / "a.glb", file, figure, morphs, tracks);
  const support::GltfPose written(folder / "a.glb");
  const auto& extras = written.json["meshes"][0]["extras"];
  EXPECT_EQ(extras["targetNames"].size(), static_cast<std::size_t>(morphs.count()));
  const auto& stored = extras["correctives"];
  EXPECT_EQ(stored["parents"], (std::vector<int>{-1, 0}));
  EXPECT_EQ(stored["lags"], (std::vector<double>{0.04}));
  EXPECT_EQ(stored["limit"], 4.0);
  const auto hidden = written.rows(stored["hidden"].get<int>());
  ASSERT_EQ(hidden.size(), 3U * 18U);
  EXPECT_EQ(hidden[18 + 7][0], 1.5);  // row 1, column 7
  EXPECT_NEAR(written.rows(stored["rest"].get<int>())[1][2], std::sqrt(0.5), 1e-6);
  EXPECT_EQ(written.rows(stored["offset"].get<int>())[1][0], static_cast<double>(0.9F));
}

}  // namespace
}  // namespace doppel::corrective_function_test
