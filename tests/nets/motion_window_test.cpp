#include "doppel/nets/motion_window.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/transform_math.h"
#include "support/gradient_check.h"
#include "support/test_character.h"

namespace doppel::motion_window_test {
namespace {

using torch::Tensor;

/// The test character with its root rotations in another order, outermost first.
Character character_with_root(const std::array<char, 3>& order) {
  Character character = make_test_character();
  for (int i = 0; i < 3; ++i) {
    Joint& joint = character.skeleton.joints[3 + i];
    joint.axis = Eigen::Vector3d::Unit(order[i] - 'x');
    joint.name = std::string("Root_r") + order[i];
    character.skeleton.dofs[3 + i].name = std::string("rotate_") + order[i];
  }
  return character;
}

Tensor random_window(const Character& character, int64_t batch, int64_t frames) {
  torch::manual_seed(11);
  return torch::randn({batch, frames, character.num_dofs()}, torch::kFloat64) * 0.5;
}

/// World transforms of the joints from the first rotation of the root on, [B,F+1,J-3,3,4]; those before it only slide,
/// so no edit of DoFs turns them.
Tensor joints_of(const Character& character, const Tensor& window) {
  Kinematics kinematics(character);
  const Tensor joints = kinematics->joints(window.flatten(0, 1));
  return joints.view({window.size(0), window.size(1), joints.size(1), 3, 4}).slice(2, 3);
}

Tensor normalised_joints(const Character& character, const Tensor& window) {
  const MotionWindow motion(character.skeleton);
  const Tensor normaliser = motion.normaliser(window.select(1, window.size(1) - 1));
  return compose(normaliser.unsqueeze(1).unsqueeze(1), joints_of(character, window));
}

double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

TEST(MotionWindowReference, WrapsToTheHalfOpenInterval) {
  const Tensor angles = torch::tensor({0.0, 3.0, 3.5, -3.5, M_PI, -M_PI, 7.0, -20.0, 3.0 * M_PI}, torch::kFloat64);
  const Tensor wrapped = wrap_angle(angles);
  EXPECT_LT(largest(wrapped.sin() - angles.sin()) + largest(wrapped.cos() - angles.cos()), 1e-12);
  EXPECT_TRUE((wrapped <= M_PI + 1e-12).all().item<bool>());
  EXPECT_TRUE((wrapped > -M_PI - 1e-12).all().item<bool>());
  EXPECT_NEAR(wrapped[4].item<double>(), M_PI, 1e-12);
  EXPECT_NEAR(wrapped[5].item<double>(), M_PI, 1e-12);
}

TEST(MotionWindowReference, MatrixAndDofNormalisationAgreeForCapturySkeletons) {
  const Character character = make_test_character();
  const Tensor window = random_window(character, 3, 4);
  const Tensor edited = MotionWindow(character.skeleton).normalise_dofs(window);
  EXPECT_LT(largest(joints_of(character, edited) - normalised_joints(character, window)), 1e-12);
}

TEST(MotionWindowReference, LastFrameStandsAtItsRestPositionAndFacesForward) {
  for (const auto& order : {std::array{'y', 'z', 'x'}, {'x', 'y', 'z'}, {'z', 'x', 'y'}}) {
    const Character character = character_with_root(order);
    const Tensor joints = normalised_joints(character, random_window(character, 3, 3));
    const Tensor root = joints.select(1, 2).select(1, 2);
    const Tensor offset = torch::tensor({0.0, 0.4, 0.07}, torch::kFloat64);
    EXPECT_LT(largest(root.select(-1, 3) - offset), 1e-12);
    if (order[0] == 'y') continue;  // there the heading is a DoF, not the azimuth of the root's z axis
    EXPECT_LT(largest(root.select(-2, 0).select(-1, 2)), 1e-12) << "the root's z axis still leans sideways";
  }
}

TEST(MotionWindowReference, TurnedAndMovedWindowsNormaliseToTheSame) {
  const Character character = make_test_character();
  const auto root = character.skeleton.root();
  const Tensor window = random_window(character, 2, 3);
  const double turn = 2.2, c = std::cos(turn), s = std::sin(turn);
  Tensor moved = window.clone();
  const Tensor x = window.select(2, root.translation[0]), z = window.select(2, root.translation[2]);
  moved.select(2, root.translation[0]).copy_(c * x + s * z + 1.5);
  moved.select(2, root.translation[1]).add_(-0.3);
  moved.select(2, root.translation[2]).copy_(-s * x + c * z - 4.0);
  moved.select(2, root.rotation[0]).add_(turn / root.rotation_weight[0]);
  EXPECT_LT(largest(normalised_joints(character, moved) - normalised_joints(character, window)), 1e-12);
}

TEST(MotionWindowReference, TheTranslationNormaliserMovesTheRootAndKeepsTheHeading) {
  for (const auto& order : {std::array{'y', 'z', 'x'}, {'x', 'y', 'z'}}) {
    const Character character = character_with_root(order);
    const MotionWindow motion(character.skeleton);
    const Tensor window = random_window(character, 3, 4);
    const Tensor normaliser = motion.translation_normaliser(window.select(1, 3)).unsqueeze(1).unsqueeze(1);
    const Tensor joints = compose(normaliser, joints_of(character, window));
    EXPECT_LT(largest(joints - joints_of(character, motion.remove_translation(window))), 1e-12);
    EXPECT_LT(largest(joints.narrow(-1, 0, 3) - joints_of(character, window).narrow(-1, 0, 3)), 1e-12);
  }
}

TEST(MotionWindowReference, HeadingIsTheDofTimesItsWeight) {
  const Character character = make_test_character();
  const auto root = character.skeleton.root();
  Tensor dofs = torch::zeros({2, character.num_dofs()}, torch::kFloat64);
  dofs[0][root.rotation[0]] = 0.2;
  dofs[1][root.rotation[0]] = 1.5;
  const Tensor heading = MotionWindow(character.skeleton).heading(dofs);
  EXPECT_NEAR(heading[0].item<double>(), 0.2 * root.rotation_weight[0], 1e-12);
  EXPECT_NEAR(heading[1].item<double>(), 1.5 * root.rotation_weight[0] - 2.0 * M_PI, 1e-12);
}

TEST(MotionWindowGradient, OfTheNormaliserMatchesCentralDifferences) {
  const Character character = character_with_root({'x', 'y', 'z'});
  const MotionWindow motion(character.skeleton);
  EXPECT_TRUE(test::gradients_match([&](const std::vector<Tensor>& x) { return motion.normaliser(x[0]); },
                                    {{"dofs", random_window(character, 2, 1).select(1, 0)}}));
}

TEST(MotionWindowRejects, EditingDofsWhenTheHeadingIsNotOutermost) {
  const Character character = character_with_root({'x', 'y', 'z'});
  EXPECT_THROW(MotionWindow(character.skeleton).normalise_dofs(random_window(character, 1, 3)), Error);
  EXPECT_THROW(MotionWindow(character.skeleton).heading(torch::zeros({2, 3})), Error);
  EXPECT_THROW(MotionWindow(character.skeleton).translation_normaliser(torch::zeros({2, 3})), Error);
}

}  // namespace
}  // namespace doppel::motion_window_test
