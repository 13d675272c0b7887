// Helper joints: weights with a known solution, and a surface that hidden joints move.
#include "doppel/actor/export/correctives/helper_joints.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "doppel/actor/export/correctives/convex_weights.h"
#include "doppel/actor/export/correctives/fit_helpers.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::helper_joints_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

Eigen::MatrixXd products_of(const Eigen::MatrixXd& points) {
  return points.transpose() * points + 1e-12 * Eigen::MatrixXd::Identity(points.cols(), points.cols());
}

TEST(ConvexWeights, AreBarycentricsOfTheNearestPoint) {
  // The origin is in the triangle of three points, with barycentrics 1/2, 1/3, 1/6.
  Eigen::MatrixXd triangle(2, 3);
  triangle << 1.0, -1.0, -1.0,  //
      1.0, -2.0, 1.0;
  EXPECT_LT((convex_weights(products_of(triangle)) - Eigen::Vector3d(0.5, 1.0 / 3.0, 1.0 / 6.0)).norm(), 1e-6);
  Eigen::MatrixXd points(2, 4);
  // It is nearest to the middle of the edge between the first two points.
  points << 1.0, 1.0, 3.0, 2.0,  //
      1.0, -1.0, 0.0, 2.0;
  EXPECT_LT((convex_weights(products_of(points)) - Eigen::Vector4d(0.5, 0.5, 0.0, 0.0)).norm(), 1e-6);
  // It is nearest to the second point.
  points << 5.0, 1.0, 3.0, 4.0,  //
      1.0, 1.0, 2.0, 1.5;
  EXPECT_LT((convex_weights(products_of(points)) - Eigen::Vector4d(0.0, 1.0, 0.0, 0.0)).norm(), 1e-6);
}

TEST(ConvexWeights, HaveTheMultipliersOfTheOptimum) {
  // E w is lambda where a weight is positive, and not less elsewhere (Karush, Kuhn, Tucker).
  test_character::Noise noise(3);
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::MatrixXd points(9, 7);
    for (double& value : points.reshaped()) value = noise.next() + 0.3;
    const Eigen::MatrixXd E = products_of(points);
    for (const Eigen::VectorXd& weights : {convex_weights(E), sparse_convex_weights(E, 2)}) {
      EXPECT_NEAR(weights.sum(), 1.0, 1e-9);
      EXPECT_GE(weights.minCoeff(), 0.0);
    }
    EXPECT_LE((sparse_convex_weights(E, 2).array() > 0.0).count(), 2);
    const Eigen::VectorXd weights = convex_weights(E), inner = E * weights;
    for (Eigen::Index i = 0; i < inner.size(); ++i) {
      EXPECT_GE(inner(i), weights.dot(inner) - 1e-6);
      if (weights(i) > 0.0) {
        EXPECT_NEAR(inner(i), weights.dot(inner), 1e-6);
      }
    }
  }
}

/// A tube one metre long over two bones. Two hidden helpers move bumps of it, besides the bones.
struct HiddenHelpers {
  static constexpr int kRings = 40, kAround = 12;
  LinearSkin skin;    // of the bones alone
  LinearSkin hidden;  // with the helpers
  SkinnedFrames frames;

  explicit HiddenHelpers(int count) {
    for (int r = 0; r < kRings; ++r)
      for (int a = 0; a < kAround; ++a) add_vertex(r / (kRings - 1.0), 2.0 * M_PI * a / kAround);
    frames.vertices.resize(3 * count, static_cast<Eigen::Index>(skin.rest.size()));
    for (int t = 0; t < count; ++t) add_frame(t);
  }

  void add_vertex(double s, double angle) {
    const double upper = 1.0 / (1.0 + std::exp(20.0 * (0.5 - s)));
    const bool second = upper > 0.5;
    skin.rest.emplace_back(0.1 * std::cos(angle), s, 0.1 * std::sin(angle));
    skin.joint.push_back({second ? 1 : 0, second ? 0 : 1, 0, 0});
    skin.weight.push_back({static_cast<float>(std::max(upper, 1.0 - upper)),
                           1.0F - static_cast<float>(std::max(upper, 1.0 - upper)), 0.0F, 0.0F});
    const auto bump = [&](double at) { return std::exp(-50.0 * (s - at) * (s - at)) * (0.6 + 0.4 * std::cos(angle)); };
    const double low = 0.8 * bump(0.25), high = 0.8 * bump(0.75), left = 1.0 - low - high;
    hidden.rest.push_back(skin.rest.back());
    hidden.joint.push_back({0, 1, 2, 3});
    hidden.weight.push_back({static_cast<float>(left * (1.0 - upper)), static_cast<float>(left * upper),
                             static_cast<float>(low), static_cast<float>(high)});
  }

  void add_frame(int t) {
    using Eigen::AngleAxisd;
    const Eigen::Vector3d joint(0.0, 0.5, 0.0);
    const Eigen::Affine3d lower(Eigen::Translation3d(0.02 * t, 0.1 * std::sin(0.3 * t), 0.0) *
                                AngleAxisd(0.1 * t, Eigen::Vector3d::UnitY()));
    const Eigen::Affine3d upper(lower * Eigen::Translation3d(joint) *
                                AngleAxisd(0.7 * std::sin(0.4 * t), Eigen::Vector3d::UnitX()) *
                                Eigen::Translation3d(-joint));
    const auto moved = [&](double at, double phase) {
      const Eigen::Vector3d centre(0.05, at, 0.0),
          shift(0.04 * std::sin(0.7 * t + phase), 0.03 * std::cos(0.9 * t + phase), 0.03 * std::sin(1.1 * t));
      const Eigen::Vector3d axis = Eigen::Vector3d(std::sin(phase), 1.0, 0.5).normalized();
      return Eigen::Translation3d(centre + shift) * AngleAxisd(0.3 * std::sin(0.8 * t + 2.0 * phase), axis) *
             Eigen::Translation3d(-centre);
    };
    frames.bones.push_back({lower, upper});
    const std::vector<Eigen::Affine3d> all{lower, upper, lower * moved(0.25, 0.4), upper * moved(0.75, 1.7)};
    frames.vertices.middleRows<3>(3 * t) =
        -left_by(hidden, all, Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(hidden.rest.size())));
  }

  SkinnedFrames first(int count) const {
    return {frames.vertices.topRows(3 * count), {frames.bones.begin(), frames.bones.begin() + count}};
  }
  /// Root of the mean squared distance in frames from one on, metres.
  double error(const HelperSkin& found, int from) const {
    const HelperPoser poser(found);
    double sum = 0.0;
    int count = 0;
    for (std::size_t t = as_size(from); t < frames.bones.size(); ++t, count += static_cast<int>(skin.rest.size())) {
      const Eigen::Matrix3Xd vertices = frames.vertices.middleRows<3>(3 * static_cast<Eigen::Index>(t));
      const auto joints = all_joints(frames.bones[t], poser.pose(frames.bones[t], vertices));
      sum += left_by(found.skin, joints, vertices).squaredNorm();
    }
    return std::sqrt(sum / count);
  }
};

TEST(HelperJoints, RecoverASurfaceOfHiddenHelpers) {
  const HiddenHelpers hidden(50);
  HelperOptions options;
  options.helpers = 2;
  options.rounds = 60;
  const HelperSkin found = find_helpers(hidden.first(40), hidden.skin, options);
  ASSERT_EQ(found.parents.size(), 2U);
  EXPECT_NE(found.parents[0], found.parents[1]);
  for (std::size_t v = 0; v < found.skin.rest.size(); ++v) {
    double sum = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_GE(found.skin.weight[v][i], 0.0F);
      if (i > 0) {
        EXPECT_LE(found.skin.weight[v][i], found.skin.weight[v][i - 1]);
      }
      EXPECT_LT(found.skin.joint[v][i], 4);
      sum += static_cast<double>(found.skin.weight[v][i]);
    }
    EXPECT_NEAR(sum, 1.0, 1e-6);
  }
  HelperSkin bones{hidden.skin, 2, {}, {}};
  const double without = hidden.error(bones, 0);
  EXPECT_GT(without, 8e-3);
  EXPECT_LT(hidden.error(found, 0), 1e-3);   // of a size of one metre
  EXPECT_LT(hidden.error(found, 40), 1e-3);  // frames that were not seen
}

TEST(HelperJoints, AreTheSameWhereverTheFramesAre) {
  // A frame may be moved as a whole.
  HiddenHelpers hidden(20);
  HelperOptions options;
  options.helpers = 3;
  options.rounds = 3;
  const HelperSkin expected = find_helpers(hidden.frames, hidden.skin, options);
  for (int t = 0; t < 20; ++t) {
    const Eigen::Affine3d away(Eigen::Translation3d(5.0 - t, 1.0, 0.5 * t) *
                               Eigen::AngleAxisd(0.6 * t, Eigen::Vector3d(1.0, 2.0, 0.5).normalized()));
    for (Eigen::Affine3d& bone : hidden.frames.bones[as_size(t)]) bone = away * bone;
    const Eigen::Matrix3Xd vertices = hidden.frames.vertices.middleRows<3>(3 * t);
    hidden.frames.vertices.middleRows<3>(3 * t) = away * vertices;
  }
  const HelperSkin found = find_helpers(hidden.frames, hidden.skin, options);
  double off = 0.0;
  for (std::size_t v = 0; v < found.skin.rest.size(); ++v)
    off = std::max(off, (found.skin.rest[v] - expected.skin.rest[v]).norm());
  EXPECT_LT(off, 1e-5);
  EXPECT_EQ(found.parents, expected.parents);
}

TEST(HelperJoints, RefuseWhatCannotBeFound) {
  const HiddenHelpers hidden(2);
  EXPECT_THAT(message_of<Error>([&] { find_helpers({}, hidden.skin, {}); }), HasSubstr("in 0 frames"));
  EXPECT_THAT(message_of<Error>([&] {
                find_helpers(hidden.frames, hidden.skin, {481, 1});
              }),
              HasSubstr("finding 481 helper joints for 480 vertices"));
}

TEST(HelperFigure, NodesFollowFromTheirParameters) {
  const Character character = make_test_character();
  const Figure bones = make_figure(character, BoneNames::skeletool);
  HelperSkin skin{{bones.rest_vertices, bones.node, bones.weight}, static_cast<int>(bones.nodes.size()), {1, 2}, {}};
  const Eigen::Affine3d mean(Eigen::Translation3d(0.01, 0.02, 0.0) *
                             Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 1.0, 0.0).normalized()));
  skin.mean = {mean, mean.inverse()};
  for (std::size_t v = 0; v < skin.skin.rest.size(); ++v)
    if (skin.skin.weight[v][1] > 0.0F) skin.skin.joint[v][1] = skin.bones + static_cast<int>(v % 2);
  const HelperFigure helpers(bones, skin);
  const Figure& figure = helpers.figure();
  ASSERT_EQ(figure.nodes.size(), bones.nodes.size() + 2);
  EXPECT_EQ(figure.nodes.back().name, "Helper_2");
  EXPECT_EQ(figure.nodes.back().parent, 2);
  // At their mean the rotations are 0, and the vertices are where the mean moves them.
  const auto standing = helpers.standing();
  const Eigen::VectorXf still = helpers.parameters(standing);
  for (const Eigen::Index at : {3, 9}) EXPECT_LT(still.segment<3>(at).norm(), 1e-6F);
  EXPECT_LT(((standing.back() * figure.rest.back().inverse()).matrix() - mean.inverse().matrix()).norm(), 1e-9);
  // The function turns numbers into the same nodes.
  std::vector<double> dofs = character.rest_dofs;
  for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += 0.1 * std::sin(1.0 + static_cast<double>(d));
  const auto posed = pose_nodes(bones, character.skeleton, dofs);
  HelperFunction function;
  const CorrectiveFunction plain = unfitted_function(bones, 0, 25.0);
  function.shares = plain;
  const Eigen::Index inputs = plain.num_inputs();
  function.shares.mean = Eigen::VectorXf::Zero(inputs);
  function.shares.scale = Eigen::VectorXf::Ones(inputs);
  function.shares.linear = Eigen::MatrixXf::Zero(12, inputs);
  function.shares.offset = Eigen::VectorXf::Constant(12, 0.75F);
  function.shares.hidden = Eigen::MatrixXf::Zero(1, inputs);
  function.shares.hidden_offset = Eigen::VectorXf::Zero(1);
  function.shares.output = Eigen::MatrixXf::Zero(12, 1);
  function.low = Eigen::VectorXf::LinSpaced(12, -1.0F, 0.2F);
  function.high = Eigen::VectorXf::LinSpaced(12, 0.1F, 0.9F);
  const auto nodes = helpers.nodes(posed, function.transforms(Eigen::VectorXf::Zero(inputs)));
  ASSERT_EQ(nodes.size(), posed.size() + 2);
  EXPECT_LT((helpers.parameters(nodes) - (0.25F * function.low + 0.75F * function.high)).norm(), 1e-5F);
}

TEST(HelperFigure, TheMetricIsHowFarVerticesMove) {
  const Character character = make_test_character();
  const Figure bones = make_figure(character, BoneNames::skeletool);
  HelperSkin skin{{bones.rest_vertices, bones.node, bones.weight}, static_cast<int>(bones.nodes.size()), {1, 2}, {}};
  skin.mean.assign(2, Eigen::Affine3d::Identity());
  for (std::size_t v = 0; v < skin.skin.rest.size(); ++v)
    for (std::size_t i = 0; i < 2; ++i)
      if (skin.skin.weight[v][i] > 0.0F) skin.skin.joint[v][i] = skin.bones + static_cast<int>(i);
  const HelperFigure helpers(bones, skin);
  const Eigen::VectorXf still = helpers.parameters(helpers.standing());
  test_character::Noise noise(5);
  Eigen::VectorXd small(12);
  for (double& value : small) value = 1e-4 * noise.next();
  std::vector<Eigen::Affine3d> local;
  for (Eigen::Index at = 0; at < 12; at += 6) {
    const Eigen::Vector3d turn = small.segment<3>(at + 3);
    local.push_back(Eigen::Translation3d(still.segment<3>(at).cast<double>() + small.segment<3>(at)) *
                    Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  }
  const auto moved = blend_transforms(helpers.figure(), helpers.nodes(bones.rest, local));
  double squares = 0.0;
  for (std::size_t v = 0; v < moved.size(); ++v)
    squares += (moved[v] * bones.rest_vertices[v] - bones.rest_vertices[v]).squaredNorm();
  EXPECT_NEAR(std::sqrt(small.dot(helpers.metric() * small) / squares), 1.0, 0.01);
}

}  // namespace
}  // namespace doppel::helper_joints_test
